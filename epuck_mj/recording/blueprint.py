"""How a recording is laid out in the viewer."""

import numpy as np
import rerun.blueprint as rrb

from epuck_mj.control import TaskParameters
from epuck_mj.geometry import arena_box
from epuck_mj.model import Scene

TIMELINE = "sim_time"


def blueprint(scene: Scene, task: TaskParameters) -> rrb.Blueprint:
    """Scene on the left, plots and summary on the right."""
    lower, upper = arena_box(scene.model)
    center, size = (lower + upper) / 2, np.linalg.norm((upper - lower)[:2])
    view = rrb.Spatial3DView(
        origin="/",
        contents=["world/**", "trial/**"],
        name="Arena",
        background=(255, 255, 255),
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            # steep: walls hide little of the floor behind them
            position=center + size * np.array([0, -0.42, 0.9]),
            look_target=center - size * np.array([0, 0.05, 0]),
            eye_up=(0, 0, 1),
        ),
        # strips of one step each, shown from the start to the cursor
        overrides={"trial/path": _until_now()},
    )
    fastest = scene.model.actuator_ctrlrange[scene.wheels].max()
    plots = [
        _plot("plot/observation", "Observation: 0 contact, 1 free", 0, 1),
        _plot("plot/action", "Action: v forward, w turn", -1, 1),
        _plot("plot/command", "Command: wheel speeds [rad/s]", -fastest, fastest),
        _plot("plot/step_fitness", "Step fitness", 0, 1, False),
        _plot("plot/cumulative_fitness", "Cumulative fitness", 0, task.steps, False),
    ]
    # room for a legend of eight
    signals = rrb.Vertical(*plots, row_shares=[2, 1, 1, 1, 1], name="Signals")
    text = rrb.TextDocumentView(origin="summary", name="Summary")
    return rrb.Blueprint(
        rrb.Horizontal(
            view,
            rrb.Tabs(signals, text),
            column_shares=[3, 2],
        ),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE),
    )


def _until_now() -> rrb.VisibleTimeRanges:
    return rrb.VisibleTimeRanges(
        timeline=TIMELINE,
        start=rrb.TimeRangeBoundary.infinite(),
        end=rrb.TimeRangeBoundary.cursor_relative(seconds=0.0),
    )


def _plot(
    entity: str, name: str, low: float, high: float, legend: bool = True
) -> rrb.TimeSeriesView:
    # a line on the frame would not be seen
    margin = 0.05 * (high - low)
    return rrb.TimeSeriesView(
        origin=entity,
        name=name,
        axis_y=rrb.ScalarAxis(range=(low - margin, high + margin)),
        plot_legend=rrb.PlotLegend("LeftBottom", visible=legend),
    )

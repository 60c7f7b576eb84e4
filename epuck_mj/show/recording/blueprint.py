"""Layout of a recording in the viewer."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from epuck_mj.scene.geometry import arena_box
from epuck_mj.scene.model import Scene
from epuck_mj.show.recording.entities import ARENA, TIMELINE, Entities

if TYPE_CHECKING:
    from epuck_mj.show.recording import Trial

PLOTTED_CLEARANCE = 60.0
"""Highest clearance that a plot shows at first [mm]: the range of wall following."""

PLOTTED_COUNTS = 4096
"""End of the proximity plot: the sensors' converters have 12 bits."""


def blueprint(
    scene: Scene, trials: Sequence["Trial"], places: Sequence[Entities]
) -> rrb.Blueprint:
    """Arena on the left, plots and summary on the right, phases below both."""
    lanes = rrb.StateTimelineView(
        contents=[place.phase for place in places], name="Phase"
    )
    # a lane each, and their axis
    share = min(0.08 + 0.045 * len(places), 0.5)
    # paths are strips of one step each, shown from the start to the cursor
    arena = arena_view(scene, [place.path for place in places])
    hidden = [trial.trajectory.hidden.shape[1] > 0 for trial in trials]
    alone = len(trials) == 1
    tabs = [] if alone else [_comparison(trials, places)]
    for trial, place, network in zip(trials, places, hidden, strict=True):
        own = _tabs(scene, trial, place, network)
        tabs += own if alone else [rrb.Tabs(*own, name=place.name)]
    text = rrb.TextDocumentView(origin="summary", name="Summary")
    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Horizontal(arena, rrb.Tabs(*tabs, text), column_shares=[3, 2]),
            # as wide as can be: short phases have room for their names
            lanes,
            row_shares=[1 - share, share],
        ),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE),
    )


def arena_view(scene: Scene, growing: Sequence[str] = ()) -> rrb.Spatial3DView:
    """View of the arena from above.

    Args:
        scene: its model.
        growing: entities of which everything up to the cursor is shown.
    """
    lower, upper = arena_box(scene.model)
    center, size = (lower + upper) / 2, np.linalg.norm((upper - lower)[:2])
    return rrb.Spatial3DView(
        origin="/",
        contents=[f"{ARENA}/**", "trials/**"],
        name="Arena",
        background=(255, 255, 255),
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            # steep: walls hide little of the floor behind them
            position=center + size * np.array([0, -0.42, 0.9]),
            look_target=center - size * np.array([0, 0.05, 0]),
            eye_up=(0, 0, 1),
        ),
        overrides={entity: _until_now() for entity in growing},
    )


def _tabs(
    scene: Scene, trial: "Trial", place: Entities, network: bool
) -> list[rrb.Container]:
    """Tabs with the plots of one trial: fitness, sensors, network and wheels."""
    steps = trial.trajectory.steps
    fastest = scene.model.actuator_ctrlrange[scene.wheels].max()
    plots = [
        plot([place.signal("observation")], "Observation: 0 contact, 1 free", 0, 1),
        plot([place.signal("action")], "Action: v forward, w turn", -1, 1),
        *_shared([place], steps),
    ]
    # room for a legend of eight
    behaviour = rrb.Vertical(*plots, row_shares=[2, 1, 1, 1, 1], name="Behaviour")
    title = "Command: wheel speeds [rad/s]"
    plots = [
        plot([place.signal("proximity")], "Proximity [counts]", 0, PLOTTED_COUNTS),
        plot([place.signal("command")], title, -fastest, fastest),
    ]
    if network:
        title = "Network: output of hidden and output neurons"
        plots.insert(1, plot([place.signal("network")], title, 0, 1))
    return [behaviour, rrb.Vertical(*plots, name="Robot")]


def _comparison(trials: Sequence["Trial"], places: Sequence[Entities]) -> rrb.Container:
    """Tabs with the plots that all trials share."""
    steps = max(trial.trajectory.steps for trial in trials)
    return rrb.Vertical(*_shared(places, steps), name="Comparison")


def _shared(places: Sequence[Entities], steps: int) -> list[rrb.View]:
    """Plots with one series per trial."""
    legend = len(places) > 1
    return [
        plot([place.signal(name) for place in places], title, 0, high, legend and first)
        for name, title, high, first in (
            ("clearance", "Clearance [mm]", PLOTTED_CLEARANCE, False),
            ("step_fitness", "Step fitness", 1, False),
            ("cumulative_fitness", "Cumulative fitness", steps, True),
        )
    ]


def _until_now() -> rrb.VisibleTimeRanges:
    return rrb.VisibleTimeRanges(
        timeline=TIMELINE,
        start=rrb.TimeRangeBoundary.infinite(),
        end=rrb.TimeRangeBoundary.cursor_relative(seconds=0.0),
    )


def plot(
    entities: Sequence[str],
    name: str,
    low: float,
    high: float,
    legend: bool = True,
    whole: bool = False,
) -> rrb.TimeSeriesView:
    """A plot of scalars.

    Args:
        entities: where they are logged.
        name: title.
        low: lowest value that is shown at first.
        high: highest.
        legend: whether there is one.
        whole: show all the time there is, and not what is around the cursor.
    """
    # a line on the frame would not be seen
    margin = 0.05 * (high - low)
    endless = rrb.TimeRangeBoundary.infinite()
    everything = rrb.TimeAxis(view_range=rr.TimeRange(start=endless, end=endless))
    return rrb.TimeSeriesView(
        contents=list(entities),
        name=name,
        axis_x=everything if whole else None,
        axis_y=rrb.ScalarAxis(range=(low - margin, high + margin)),
        plot_legend=rrb.PlotLegend("LeftBottom", visible=legend),
    )

"""Live view of a run: curves, and a trial of the best individual.

Everything is on the timelines `evaluations` and `generation`: moving the cursor back
shows what the best individual did then.
"""

from collections.abc import Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from epuck_mj.scene.geometry import kinematics, moving_bodies
from epuck_mj.scene.model import Scene
from epuck_mj.scene.robot_parts import ROBOT_BODY
from epuck_mj.show.colors import BLUE, HIGH_FITNESS, LOW_FITNESS, VERMILION, blend
from epuck_mj.show.recording.blueprint import arena_view, plot
from epuck_mj.show.recording.entities import APPLICATION, Entities
from epuck_mj.show.recording.motion import MARK_HEIGHT, PATH_HEIGHT
from epuck_mj.show.recording.shapes import body_name, log_arena, log_robot
from epuck_mj.trials.trajectory import Trajectory

TIMELINE = "evaluations"

BEST = Entities("best individual", "trials/best", BLUE, alone=True)
FITNESS, CRASHES, TEXT = "run/fitness", "run/crash_rate", "run/summary"

PATIENCE = 2.0
"""How long a viewer may take to accept what was sent last [s]."""


class LiveView:
    """A stream to a running viewer."""

    def __init__(self, address: str, scene: Scene, title: str, steps: int):
        """Connect, and show the arena.

        Args:
            address: of the viewer, `rerun+http://host:port/proxy`.
            scene: where trials will be.
            title: the recording's name.
            steps: control steps of a trial, the highest fitness there is.
        """
        self._scene = scene
        self._stream = rr.RecordingStream(APPLICATION + "_live", send_properties=False)
        self._stream.connect_grpc(address)
        # a viewer that has seen another run would keep that one's
        self._stream.send_blueprint(_blueprint(scene, steps))
        self._stream.send_recording_name(title)
        log_arena(self._stream, scene.model)
        log_robot(self._stream, scene.model, BEST)
        for entity, names, colors in (
            (FITNESS, ("best", "mean"), (BLUE, VERMILION)),
            (CRASHES, ("crash rate",), (VERMILION,)),
        ):
            style = rr.SeriesLines(names=names, colors=colors)
            self._stream.log(entity, style, static=True)

    def generations(
        self,
        evaluations: Sequence[int],
        generations: Sequence[int],
        fitness: np.ndarray,
        crash_rate: np.ndarray,
    ) -> None:
        """Add generations to the curves.

        Args:
            evaluations: spent by the end of each generation, `(n,)`.
            generations: their numbers, `(n,)`.
            fitness: best and mean stored fitness, `(n, 2)`.
            crash_rate: of all trials of each, `(n,)`.
        """
        times = [
            rr.TimeColumn(TIMELINE, sequence=evaluations),
            rr.TimeColumn("generation", sequence=generations),
        ]
        both = rr.Scalars.columns(scalars=fitness.ravel())
        both = both.partition(np.full(len(fitness), 2))
        self._stream.send_columns(FITNESS, times, both)
        rates = rr.Scalars.columns(scalars=crash_rate)
        self._stream.send_columns(CRASHES, times, rates)

    def trial(
        self, evaluations: int, generation: int, trajectory: Trajectory, summary: str
    ) -> None:
        """Show a trial of the best individual.

        Args:
            evaluations: spent so far.
            generation: its generation.
            trajectory: its trial.
            summary: Markdown for the text panel.
        """
        stream, model = self._stream, self._scene.model
        stream.set_time(TIMELINE, sequence=evaluations)
        stream.set_time("generation", sequence=generation)
        position, quaternion, *_ = kinematics(self._scene, trajectory.pose)
        for body in moving_bodies(model):
            place = rr.Transform3D(
                translation=position[-1, body],
                quaternion=quaternion[-1, body][[1, 2, 3, 0]],
            )
            stream.log(BEST.body(body_name(model, body)), place)
        root = position[:, model.body(ROBOT_BODY).id] + [0, 0, PATH_HEIGHT]
        path = rr.LineStrips3D(
            np.stack([root[:-1], root[1:]], axis=1, dtype=np.float32),
            colors=blend(LOW_FITNESS, HIGH_FITNESS, trajectory.fitness),
            radii=0.002,
        )
        stream.log(BEST.path, path)
        mark = root[-1:] + np.array([0, 0, MARK_HEIGHT])
        # none takes the last one's away
        mark = mark if trajectory.crashed else np.zeros((0, 3))
        crash = rr.Points3D(mark, radii=0.012, colors=VERMILION, labels="crash")
        stream.log(BEST.crash, crash)
        stream.log(TEXT, rr.TextDocument(summary, media_type=rr.MediaType.MARKDOWN))

    def flush(self) -> None:
        """Wait until the viewer has everything.

        Raises:
            ConnectionError: if it does not take it.
        """
        try:
            self._stream.flush(timeout_sec=PATIENCE)
        except RuntimeError as error:
            raise ConnectionError(str(error)) from None

    def close(self) -> None:
        """Disconnect from the viewer, which keeps its data; may wait for the viewer."""
        self._stream.disconnect()


def _blueprint(scene: Scene, steps: int) -> rrb.Blueprint:
    """Arena on the left, curves on the right."""
    plots = rrb.Vertical(
        plot([FITNESS], "Stored fitness against evaluations", 0, steps, whole=True),
        plot([CRASHES], "Crash rate", 0, 1, legend=False, whole=True),
        rrb.TextDocumentView(origin=TEXT, name="Best individual"),
        row_shares=[3, 1, 1],
    )
    return rrb.Blueprint(
        rrb.Horizontal(arena_view(scene), plots, column_shares=[3, 2]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="Following"),
    )

"""Pictures of a drive: a recording and a figure. They load rerun and matplotlib.

So they are for robots that stand.
"""

from pathlib import Path

from epuck_mj.bridge.drive.log import log_file
from epuck_mj.scene.model import Scene
from epuck_mj.show.figures import trajectory_figure
from epuck_mj.show.pictures import save_figure
from epuck_mj.show.recording import Trial, save_recording
from epuck_mj.step.control import TaskParameters
from epuck_mj.trials.trajectory import Trajectory


def save_pictures(
    name: Path,
    trajectory: Trajectory,
    summary: str,
    task: TaskParameters,
    scene: Scene,
    placed: bool,
) -> list[Path]:
    """Write the recording and the figure of a drive; the files.

    Args:
        name: of the log without its endings.
        trajectory: with one control step or more; its pose is odometry.
        summary: Markdown for the recording.
        task: what the robot was at.
        scene: to show it in.
        placed: whether it is known where in the scene it started; if not, the figure
            has no walls.

    Raises:
        UserError: if they cannot be written.
    """
    picture, recording = log_file(name, ".png"), log_file(name, ".rrd")
    title = f"{name.name}\npath by odometry, {trajectory.time[-1]:.0f} s"
    figure = trajectory_figure(scene, [trajectory], task, [title], walls=placed)
    save_figure(figure, picture)
    trial = Trial("robot", trajectory, task)
    save_recording(recording, scene, [trial], name.name, summary)
    return [recording, picture]

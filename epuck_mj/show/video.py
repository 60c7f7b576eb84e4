"""Videos: trials as .mp4, drawn by MuJoCo and packed by ffmpeg.

Only here is `imageio_ffmpeg` imported, an extra that brings ffmpeg along.
"""

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from epuck_mj.errors import UserError
from epuck_mj.host.files import write_bytes, writing
from epuck_mj.scene.model import Scene
from epuck_mj.show.render import painter
from epuck_mj.trials.trajectory import Trajectory

try:
    import imageio_ffmpeg
except ModuleNotFoundError as error:
    raise UserError(
        f"a video needs '{error.name}', which is not installed: "
        "pip install 'epuck-mj[video]'"
    ) from None

FRAME_RATE = 25
"""Pictures per second; poses between control steps are interpolated."""

LAST_LOOK = 1.0
"""How long the last picture is shown [s]."""


def save_video(
    path: str | Path,
    scene: Scene,
    trajectories: Sequence[Trajectory],
    width: int,
    height: int,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> None:
    """Write trials as they happened, in real time.

    Args:
        path: of the .mp4.
        scene: where the trajectories were recorded.
        trajectories: what happened, at least one.
        width: of the pictures [pixels], even.
        height: of the pictures [pixels], even.
        progress: told after every picture how many there are, and of how many.

    Raises:
        UserError: if no OpenGL is there, or the file cannot be written.
    """
    duration = max(trajectory.time[-1] for trajectory in trajectories) + LAST_LOOK
    times = np.arange(0, duration, 1 / FRAME_RATE)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "video.mp4")
        with painter(scene, trajectories, width, height, draft=True) as artist:
            frames = imageio_ffmpeg.write_frames(
                str(file),
                (width, height),
                fps=FRAME_RATE,
                macro_block_size=2,
                # what went wrong is said in one line
                ffmpeg_log_level="quiet",
            )
            frames.send(None)
            try:
                for i, time in enumerate(times):
                    picture = np.ascontiguousarray(artist.picture(time))
                    try:
                        frames.send(picture)
                    except OSError:
                        break
                    progress(i + 1, len(times))
            finally:
                frames.close()
        if _n_frames(file) != len(times):
            raise UserError(
                f"cannot write '{path}': ffmpeg could not finish it; is there room in "
                f"the folder for temporary files, '{tempfile.gettempdir()}'?"
            )
        with writing():
            write_bytes(Path(path), file.read_bytes())


def _n_frames(file: Path) -> int | None:
    """Number of pictures that can be read from a video; ffmpeg does not say if all."""
    try:
        return imageio_ffmpeg.count_frames_and_secs(str(file))[0]
    except RuntimeError:
        return 0

"""The command line of replay: what to show, where, and as what."""

import math
import sys
import webbrowser
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro
from tqdm import tqdm

from epuck_mj.errors import UserError
from epuck_mj.host.command_line import command, main, parse
from epuck_mj.host.files import writing
from epuck_mj.scene.geometry import arena_box
from epuck_mj.scene.model import Scene, load_scene
from epuck_mj.show.recording import Trial, save_recording
from epuck_mj.step.conditions import Conditions, NoiseLevel
from evolution.judging.held_out import WHEELED_ROBOT
from evolution.named_policies import NamedPolicy, described, named_policies
from evolution.replay.trials import (
    Starts,
    from_file,
    labels,
    numbered_starts,
    simulated,
)
from evolution.replay.viewer import display_there, open_viewer
from evolution.replay.web import LOOPBACK, server, write_page

MODULE = "evolution.replay"

IMAGE_SIZE, VIDEO_SIZE = (1200, 800), (960, 640)
"""Width and height [pixels]."""


@dataclass(frozen=True)
class Options:
    """Watch champions drive: in the rerun viewer, a browser, a video or a picture.

    Without --save, --web, --video and --image, the recording is written beside what is
    replayed, and the viewer opens if there is a display.

    Attributes:
        path: run directory, controller file, wall-follower, or a recorded trajectory
            (.npz) of a simulated or a real robot.
        compare: more of them, in the same arena at the same time.
        generations: instead of champions, the best individuals of these generations of
            the runs: numbers from 0 on and last, with commas in between.
        trials: on how many test starts.
        starts: on which starts instead, such as test:0-9 or validation:7.
        pose: on which start instead: x [m], y [m] and heading [degrees].
        robot: robot that drives.
        arena: arena to drive in; the one it evolved in if not given.
        noise: none for ideal sensors and motors, calibrated or strong for real ones; as
            it evolved if neither this nor the next two are given.
        randomise: another robot in each trial; needs noise.
        calibration: file of python -m epuck_mj.calibrate: that robot in all trials;
            needs noise.
        save: write the recording here (.rrd).
        web: write it as a web page into this folder, and serve that on 127.0.0.1.
        video: write a video here (.mp4); needs EGL or OSMesa.
        image: write a picture of the end here (.png); needs EGL or OSMesa.
    """

    path: tyro.conf.Positional[str] = ""
    compare: tuple[str, ...] = ()
    generations: str | None = None
    trials: int | None = None
    starts: str | None = None
    pose: tuple[float, ...] = ()
    robot: str = WHEELED_ROBOT
    arena: str | None = None
    noise: NoiseLevel | None = None
    randomise: bool = False
    calibration: Path | None = None
    save: Path | None = None
    web: Path | None = None
    video: Path | None = None
    image: Path | None = None


def replay(argv: Sequence[str]) -> int:
    """Run the command line; its exit status.

    Raises:
        UserError: for anything the user can put right.
    """
    options = parse(Options, f"python -m {MODULE}", argv)
    paths = [path for path in (options.path, *options.compare) if path]
    if not paths:
        raise UserError(
            "expected what to replay: a run directory, a controller file, "
            "wall-follower or a trajectory (.npz)"
        )
    recorded = [from_file(path) for path in paths if path.endswith(".npz")]
    policies = [
        policy
        for path in paths
        if not path.endswith(".npz")
        for policy in named_policies(path, options.generations)
    ]
    conditions = Conditions.asked(options.noise, options.randomise, options.calibration)
    scene = _scene(options, policies)
    starts = _starts(options, scene, policies)
    trials = [*simulated(scene, policies, starts, conditions), *recorded]
    for trial in trials:
        print(_outcome(trial))
    title = ", ".join(labels(policies) or [trial.name for trial in recorded])
    _show(options, _Show(scene, trials, title, _summary(trials, policies)), paths[0])
    return 0


def _scene(options: Options, policies: Sequence[NamedPolicy]) -> Scene:
    """The one scene that everybody drives in."""
    arenas = dict.fromkeys(policy.arena for policy in policies) or {"arena": None}
    if options.arena is None and len(arenas) > 1:
        raise UserError(
            f"evolved in different arenas ({', '.join(arenas)}): expected --arena to "
            "say in which they are to be compared"
        )
    control_steps = {policy.task.control_step for policy in policies} or {0.1}
    if len(control_steps) > 1:
        raise UserError(
            f"expected policies with the same control step, got {sorted(control_steps)}"
        )
    arena = options.arena or next(iter(arenas))
    return load_scene(options.robot, arena, control_steps.pop())


def _starts(options: Options, scene: Scene, policies: Sequence[NamedPolicy]) -> Starts:
    """The starts to drive from."""
    ways = (options.trials, options.starts, options.pose or None)
    if sum(way is not None for way in ways) > 1:
        raise UserError("expected one of --trials, --starts and --pose, got several")
    if not policies and (any(ways) or options.generations is not None):
        raise UserError(
            "expected a policy for --trials, --starts, --pose or --generations: a "
            "recorded trajectory is what it is"
        )
    if options.pose:
        if len(options.pose) != 3 or not np.isfinite(options.pose).all():
            raise UserError(
                "expected --pose with x [m], y [m] and heading [degrees], got "
                + " ".join(f"{number:g}" for number in options.pose)
            )
        return Starts.from_pose(_pose(scene, *options.pose))
    trials = 1 if options.trials is None else options.trials
    if trials < 1:
        raise UserError(f"expected at least 1 trial, got {trials}")
    if not policies:
        return Starts.none()
    # the widest: a start that is free for one is free for all
    clearance = max(policy.start_clearance for policy in policies)
    spec = options.starts or f"test:0-{trials - 1}"
    return numbered_starts(spec, scene, clearance)


def _pose(scene: Scene, x: float, y: float, degrees: float) -> np.ndarray:
    """A pose `(3,)` between the walls, wherever they are."""
    lower, upper = arena_box(scene.model)
    if not ((lower[:2] <= (x, y)) & ((x, y) <= upper[:2])).all():
        raise UserError(
            f"expected --pose in the arena, x from {lower[0]:g} to {upper[0]:g} and y "
            f"from {lower[1]:g} to {upper[1]:g}, got {x:g} {y:g}"
        )
    return np.array([x, y, math.radians(math.remainder(degrees, 360))])


def _outcome(trial: Trial) -> str:
    trajectory = trial.trajectory
    end = f", crash after {trajectory.time[-1]:.1f} s" if trajectory.crashed else ""
    return (
        f"{trial.name}: fitness {trajectory.trial_fitness:.1f} of {trial.task.steps}"
        + end
    )


def _summary(trials: Sequence[Trial], policies: Sequence[NamedPolicy]) -> str:
    """The text panel: what is shown, then what is known of who drives."""
    lines = [f"- {_outcome(trial)}" for trial in trials]
    known = [described(policy) for policy in policies]
    return "\n".join(["# Trials", "", *lines, "", *known])


@dataclass(frozen=True)
class _Show:
    """What is to be shown."""

    scene: Scene
    trials: Sequence[Trial]
    title: str
    summary: str

    def save(self, path: Path) -> None:
        _make_folder(path)
        save_recording(path, self.scene, self.trials, self.title, self.summary)


def _show(options: Options, show: _Show, path: str) -> None:
    """Write what was asked for; the recording and a window if nothing was."""
    trajectories = [trial.trajectory for trial in show.trials]
    if options.save is not None:
        show.save(options.save)
        print(f"{options.save}; watch it: {command('rerun', options.save)}")
    if options.image is not None:
        _draw(options.image, show.scene, trajectories)
        print(options.image)
    if options.video is not None:
        _film(options.video, show.scene, trajectories)
        print(options.video)
    if options.web is not None:
        show.save(options.web / "replay.rrd")
        _serve(options.web)
    if not (options.save or options.image or options.video or options.web):
        place = Path(path)
        recording = (place if place.is_dir() else place.parent) / "replay.rrd"
        show.save(recording)
        _open(recording)


def _open(recording: Path) -> None:
    """The viewer, or how to get one."""
    how = f"watch it: {command('rerun', recording)}"
    if not display_there():
        print(f"{recording}; there is no display here; {how}")
    elif reason := open_viewer(recording):
        print(f"{recording}; the viewer did not open ({reason}); {how}")
    else:
        print(f"{recording}, in the viewer")


def _make_folder(path: Path) -> None:
    """Of a file that is to be written: before the work, not behind it."""
    with writing():
        path.parent.mkdir(parents=True, exist_ok=True)


def _draw(path: Path, scene: Scene, trajectories: Sequence) -> None:
    # OpenGL and matplotlib only for those who want them
    from epuck_mj.show.pictures import save_pixels
    from epuck_mj.show.render import painter

    _make_folder(path)
    with painter(scene, trajectories, *IMAGE_SIZE) as artist:
        pixels = artist.picture()
    save_pixels(pixels, path)


def _film(path: Path, scene: Scene, trajectories: Sequence) -> None:
    # the same, and ffmpeg
    from epuck_mj.show.video import save_video

    _make_folder(path)
    with tqdm(unit="frame", disable=not sys.stderr.isatty()) as bar:

        def show(done: int, total: int) -> None:
            bar.total = total
            bar.update(done - bar.n)

        save_video(path, scene, trajectories, *VIDEO_SIZE, show)


def _serve(folder: Path) -> None:
    """The page, until Ctrl-C."""
    write_page(folder)
    with server(folder) as web:
        address = f"http://{LOOPBACK}:{web.server_port}/"
        try:
            # from the moment it is promised
            print(f"{folder}, served at {address} until Ctrl-C", flush=True)
            if display_there():
                webbrowser.open(address)
            web.serve_forever()
        except KeyboardInterrupt:
            print()


if __name__ == "__main__":
    main(replay)

"""Options of `python -m evolution.replay`."""

from dataclasses import dataclass, field
from pathlib import Path

import tyro

from epuck_mj.scene.model_files import WHEELED_ROBOT
from epuck_mj.step.conditions import ConditionFlags


@dataclass(frozen=True)
class Options:
    """Watch champions drive in the rerun viewer, a browser, a video or a picture.

    Without --save, --web, --video and --image, the recording is written into the run
    directory or beside the file, and the viewer opens if there is a display.

    Attributes:
        path: run directory, controller file, wall-follower, or a recorded trajectory
            (.npz) of a simulated or a real robot.
        compare: more of these, shown in the same arena at the same time.
        generations: show the best individuals of these generations instead of the
            champions: numbers from 0 on, or last, separated by commas.
        trials: number of trials, on the first test starts.
        starts: starts to use instead, such as test:0-9 or validation:7.
        pose: one start to use instead: x [m], y [m] and heading [degrees].
        robot: robot that drives.
        arena: arena to drive in; if not given, the one that the champion evolved in.
        robots: noise and differences of the robots; if not given, those that the
            champion evolved with.
        save: file to write the recording to (.rrd).
        web: folder to write a web page into, which is then served on 127.0.0.1.
        video: file to write a video to (.mp4); needs EGL or OSMesa.
        image: file to write a picture of the end to (.png); needs EGL or OSMesa.
    """

    path: tyro.conf.Positional[str] = ""
    compare: tuple[str, ...] = ()
    generations: str | None = None
    trials: int | None = None
    starts: str | None = None
    pose: tuple[float, ...] = ()
    robot: str = WHEELED_ROBOT
    arena: str | None = None
    robots: ConditionFlags = field(default_factory=ConditionFlags)
    save: Path | None = None
    web: Path | None = None
    video: Path | None = None
    image: Path | None = None

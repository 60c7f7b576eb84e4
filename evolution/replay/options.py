"""What a person may ask of `python -m evolution.replay`."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from epuck_mj.host.command_line import word
from epuck_mj.scene.model_files import WHEELED_ROBOT
from epuck_mj.step.conditions import ConditionFlags


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
        robots: what the robots are like; as a champion's were if not given.
        save: write the recording here (.rrd).
        web: write it as a web page into this folder, and serve that on 127.0.0.1.
        video: write a video here (.mp4); needs EGL or OSMesa.
        image: write a picture of the end here (.png); needs EGL or OSMesa.
    """

    path: tyro.conf.Positional[Annotated[str, word("RUN")]] = ""
    compare: Annotated[tuple[str, ...], word("RUN")] = ()
    generations: Annotated[str | None, word("NUMBERS")] = None
    trials: Annotated[int | None, word("N")] = None
    starts: Annotated[str | None, word("STARTS")] = None
    pose: Annotated[tuple[float, ...], word("X Y DEGREES")] = ()
    robot: Annotated[str, word("ROBOT")] = WHEELED_ROBOT
    arena: Annotated[str | None, word("ARENA")] = None
    robots: ConditionFlags = field(default_factory=ConditionFlags)
    save: Annotated[Path | None, word("FILE")] = None
    web: Annotated[Path | None, word("FOLDER")] = None
    video: Annotated[Path | None, word("FILE")] = None
    image: Annotated[Path | None, word("FILE")] = None

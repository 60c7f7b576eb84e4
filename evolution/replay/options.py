"""Options of `python -m evolution.replay`."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from epuck_mj.host.command_line import word
from epuck_mj.step.condition_flags import ConditionFlags


@dataclass(frozen=True)
class Options:
    """Watch champions drive in the rerun viewer, a browser, a video or a picture.

    Without --save, --web, --video and --image, the recording is written into the run
    directory, beside the file, or else into the current folder, and the viewer opens if
    there is a display.

    Attributes:
        path: run directory, controller file, wall-follower, or a recorded trajectory
            (.npz) of a simulated or a real robot.
        compare: more paths, shown in the same arena at the same time.
        generations: show the best individuals of these generations instead of the
            champions: numbers from 0 on, or last, separated by commas.
        trials: number of trials, on the first test starts; if not given, one trial,
            on the start among the first 25 where the policy has its median fitness.
        starts: starts to use instead, such as test:0-9 or validation:7.
        pose: one start to use instead: x [m], y [m] and heading [degrees].
        robot: robot that drives; if not given, the one on wheels that all champions
            were tested on, or else epuck.
        arena: arena to drive in; if not given, the one that the champion evolved in.
        robots: noise and differences of the robots; if not given, those that the
            champion evolved with.
        save: file to write the recording to (.rrd).
        web: folder to write a web page into, which is then served on 127.0.0.1.
        video: file to write a video to (.mp4); needs EGL or OSMesa.
        image: file to write a picture of the end to (.png); needs EGL or OSMesa.
    """

    path: tyro.conf.Positional[Annotated[str, word("RUN")]] = ""
    compare: Annotated[tuple[str, ...], word("RUN")] = ()
    generations: Annotated[str | None, word("NUMBERS")] = None
    trials: Annotated[int | None, word("N")] = None
    starts: Annotated[str | None, word("STARTS")] = None
    pose: Annotated[tuple[float, ...], word("X Y DEGREES")] = ()
    robot: Annotated[str | None, word("ROBOT")] = None
    arena: Annotated[str | None, word("ARENA")] = None
    robots: ConditionFlags = field(default_factory=ConditionFlags)
    save: Annotated[Path | None, word("FILE")] = None
    web: Annotated[Path | None, word("FOLDER")] = None
    video: Annotated[Path | None, word("FILE")] = None
    image: Annotated[Path | None, word("FILE")] = None

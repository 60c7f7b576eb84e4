"""What a person may ask of `python -m evolution.replay`."""

from dataclasses import dataclass
from pathlib import Path

import tyro

from epuck_mj.scene.model_files import WHEELED_ROBOT
from epuck_mj.step.conditions import NoiseLevel


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

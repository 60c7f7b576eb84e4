"""A robot from its log: `python -m epuck_mj.calibrate fit drive.npz`."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from epuck_mj.constants import N_PROXIMITY, WHEEL_RADIUS
from epuck_mj.errors import UserError
from epuck_mj.host.command_line import parse, pose_flag, word
from epuck_mj.host.files import check_writable, is_file
from epuck_mj.host.output import say
from epuck_mj.step.calibration import Calibration

if TYPE_CHECKING:
    from epuck_mj.calibrate.drive_fit import DriveFit
    from epuck_mj.calibrate.recorded_drive import RecordedDrive

EXAMPLES = (
    "python -m epuck_mj.calibrate fit runs/drive.npz",
    "python -m epuck_mj.calibrate fit drive.npz --arena my.xml --output robot.yaml",
)


@dataclass(frozen=True)
class FitOptions:
    """Find out from a drive's log how the robot differs from the nominal robot.

    Attributes:
        log: the .npz file that python -m epuck_mj.bridge has written.
        arena: arena that the robot drove in.
        pose: start of the robot, x and y [m] and heading [degrees], within about 2 cm
            and 10 degrees; if not given, the start that the log has.
        output: file to write; values that the drive does not show stay the same.
    """

    log: tyro.conf.Positional[Annotated[Path | None, word("FILE")]] = None
    arena: Annotated[str, word("ARENA")] = "arena"
    pose: Annotated[tuple[float, float, float] | None, word("X Y DEGREES")] = None
    output: Annotated[Path, word("FILE")] = Path("robot.yaml")


def fit(argv: Sequence[str]) -> int:
    """Run the command line behind `fit` and return its exit status."""
    prog = "python -m epuck_mj.calibrate fit"
    options = parse(FitOptions, prog, argv, examples=EXAMPLES)
    if options.log is None:
        raise UserError("expected the log of a drive, as fit drive.npz")
    start = pose_flag(options.pose)
    check_writable(options.output)
    output = options.output
    known = Calibration.load(output) if is_file(output) else Calibration()
    # slow to import, and not needed for --help
    import numpy as np

    from epuck_mj.calibrate.drive_fit import fit_drive
    from epuck_mj.calibrate.recorded_drive import load_drive
    from epuck_mj.scene.model import load_scene
    from epuck_mj.scene.model_files import KINEMATIC_ROBOT

    drive = load_drive(options.log, None if start is None else np.array(start))
    scene = load_scene(KINEMATIC_ROBOT, options.arena)
    found = fit_drive(drive, scene, known)
    say(report(drive, known, found))
    found.calibration.save(output)
    say(f"written: {output}")
    return 0


def report(drive: "RecordedDrive", known: Calibration, found: "DriveFit") -> str:
    """What a fit found, and how well that explains the drive, as text.

    Args:
        drive: that was fitted.
        known: what was known of the robot before.
        found: the fit.
    """
    from epuck_mj.calibrate.drive_fit import SLIPS

    x, y, yaw = found.start.tolist()
    n = len(drive.rates)
    lines = [
        f"{n} control steps of {1000 * drive.control_step:.0f} ms, "
        f"{drive.way * WHEEL_RADIUS:.2f} m; start x {x:.3f} m, y {y:.3f} m, "
        f"heading {math.degrees(yaw):.1f} degrees",
        "",
        f"{'':24}{'before':>10}{'fitted':>10}{'+-':>8}",
        *_values(drive, known, found),
        "",
        f"{'what is left, rms':32}{'number':>8}{'before':>9}{'after':>9}",
    ]
    lines += [
        f"{each.name:32}{each.n:8}{each.before:9.2f}{each.after:9.2f} {each.unit}"
        for each in found.quantities
        if each.n
    ]
    about = "at most" if found.slip == min(SLIPS) else "about"
    lines.append(f"wheels slip by {about} {100 * found.slip:g} % in a control step")
    if found.jump is not None:
        lines.append(
            f"warning: {found.jump.time:.1f} s after the start the robot seems to have "
            f"been moved by {1000 * found.jump.way:.0f} mm and "
            f"{math.degrees(found.jump.turn):.0f} degrees; or it started elsewhere "
            "(--pose), or the arena is another"
        )
    return "\n".join(lines)


@dataclass(frozen=True)
class _Value:
    """A value before and after, its error, and why a drive may not show it."""

    name: str
    unit: str
    digits: int
    before: float
    fitted: float
    error: float
    shown: bool
    why: str


def _values(drive: "RecordedDrive", known: Calibration, found: "DriveFit") -> list[str]:
    new, shown, errors = found.calibration, found.shown.tolist(), found.errors.tolist()
    way, walls = drive.way * WHEEL_RADIUS, int(found.n_near.sum())
    rolled = f"it rolled {way:.2f} m with {walls} readings near walls"
    turned = f"it turned {math.degrees(found.turned):.0f} degrees in all"
    values = [
        *(
            _Value(
                f"{side} wheel radius", "mm", 3, 1000 * known.wheel_radii[i],
                1000 * new.wheel_radii[i], 1000 * new.wheel_radii[i] * errors[i],
                shown[i], rolled,
            )
            for i, side in enumerate(("left", "right"))
        ),
        _Value(
            "track", "mm", 2, 1000 * known.track, 1000 * new.track,
            1000 * new.track * errors[2], shown[2], turned,
        ),
        _Value(
            "latency", "control steps", 0, known.latency, new.latency,
            found.delay.error / drive.control_step, found.delay.known,
            "its commands hardly changed",
        ),
        _Value(
            "lag of the drive", "of nominal", 2, known.lag, new.lag, errors[3],
            shown[3], f"{turned}, with {walls} readings near walls",
        ),
        *(
            _Value(
                f"gain of ps{i}", "", 3, known.proximity_gains[i],
                new.proximity_gains[i], new.proximity_gains[i] * errors[4 + i],
                shown[4 + i], f"{int(found.n_near[i])} readings near walls",
            )
            for i in range(N_PROXIMITY)
        ),
    ]  # fmt: skip
    return [_line(value) for value in values]


def _line(value: _Value) -> str:
    before = f"{value.name:24}{value.before:10.{value.digits}f}"
    if not value.shown:
        return f"{before}{'kept':>10}  not shown: {value.why}"
    error = f"{value.error:8.{max(value.digits, 2)}f}"
    return f"{before}{value.fitted:10.{value.digits}f}{error} {value.unit}".rstrip()

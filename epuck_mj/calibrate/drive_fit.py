"""Fit of a robot's parameters to a recorded drive, and how well they explain it."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.linalg import LinAlgError

from epuck_mj.calibrate.command_delay import CommandDelay, fit_delay
from epuck_mj.calibrate.drive_model import FAR, SIGHT, DriveModel
from epuck_mj.calibrate.fitting import GAINS as GAIN_LIMITS
from epuck_mj.calibrate.fitting import (
    SATURATED,
    TRACKS,
    checked_wheel_radii,
    refuse_outside,
)
from epuck_mj.calibrate.parameters import (
    GAINS,
    LAG,
    LEFT,
    N_PARAMETERS,
    OWN_TRACK,
    RIGHT,
    parameters_of,
)
from epuck_mj.calibrate.quantities import Quantity, motor_steps, paths, readings
from epuck_mj.calibrate.recorded_drive import RecordedDrive
from epuck_mj.calibrate.smoothing import (
    CAUCHY,
    OUTLIER,
    Prior,
    Smoothed,
    followed,
    smooth,
)
from epuck_mj.constants import N_PROXIMITY, TRACK, WHEEL_RADIUS
from epuck_mj.errors import UserError
from epuck_mj.rungs.kinematic.plan import Plan, plan_of
from epuck_mj.scene.model import Scene
from epuck_mj.step.calibration import Calibration

SLIPS = (0.08, 0.05, 0.03, 0.02, 0.01, 0.005)
"""Relative slip of wheels in a control step: the likeliest is taken.

Chosen around the 3 % of `NOISE`; the least is what counters do not tell about a motor's
pace within a control step.
"""

FIRST_SLIP = 0.02
"""Slip with which a drive is followed."""

ERRORS_MAX = np.array([0.005, 0.005, 0.01, 0.15, *[0.05] * N_PROXIMITY])
"""Standard errors up to which a drive shows a parameter, relative to it.

Chosen: a quarter and less of the range in which robots differ (`RANGES`).
"""

NEAR, REACH = 300.0, 2
"""Counts that a wall gives at least, that many control steps before or after a reading
that it saturates. Chosen: about half of what is published for 20 mm."""

LAG_MIN = 0.05
"""Least lag that is written: none at all is no first-order lag."""

STRANGE_MAX = 0.1
"""Share of outliers among readings near walls up to which a fit is one. Chosen: of
emulated robots, some of which touch walls, it is below 0.01."""

JUMP = (0.03, 0.2)
"""Way [m] and turn [rad] in a control step beyond which a robot was moved. Chosen: at
full speed, one that pushes a wall stands for 0.013 m."""

JUMP_MAX = (0.1, 1.0)
"""The same beyond which nothing can be told from a drive. Chosen."""


@dataclass(frozen=True)
class Jump:
    """A move that neither wheels nor slip explain.

    Attributes:
        time: when [s].
        way: how far [m].
        turn: by what angle [rad].
    """

    time: float
    way: float
    turn: float


@dataclass(frozen=True, eq=False)
class DriveFit:
    """A robot as a drive shows it.

    Attributes:
        calibration: fitted; of what the drive does not show, the known values.
        shown: whether the drive shows each parameter, `(12,)`, bool.
        errors: standard error of each parameter, relative to it, `(12,)`.
        delay: of commands.
        slip: likeliest slip of the wheels in a control step, relative to their way.
        start: most likely start: x, y [m], yaw [rad], `(3,)`.
        turned: by all turns, back and forth alike [rad].
        n_near: readings of each sensor near a wall, `(8,)`.
        jump: the largest, if the robot seems to have been moved.
        quantities: how well it explains the drive.
    """

    calibration: Calibration
    shown: np.ndarray
    errors: np.ndarray
    delay: CommandDelay
    slip: float
    start: np.ndarray
    turned: float
    n_near: np.ndarray
    jump: Jump | None
    quantities: tuple[Quantity, ...]


def fit_drive(drive: RecordedDrive, scene: Scene, known: Calibration) -> DriveFit:
    """Fit a robot to a drive in an arena.

    Args:
        drive: that was recorded.
        scene: the kinematic robot in the arena.
        known: what is known of the robot.

    Raises:
        UserError: if the drive does not fit the arena, shows nothing, or shows a robot
            that no e-puck is.
    """
    drive = replace(drive, counts=without_spikes(drive.counts))
    delay = fit_delay(drive)
    if not delay.known:
        late = known.latency * drive.control_step
        delay = replace(delay, delay=late, latency=known.latency)
    plan = _plan(scene, drive.control_step)
    model = DriveModel(drive, plan, delay.delay, FIRST_SLIP, 0, len(drive.time) - 1)
    before = parameters_of(known)
    prior = Prior(drive.start, before)
    near = (drive.counts > FAR) & (drive.counts < SATURATED)
    try:
        model, joint = _likeliest(model, before)
        _refuse_strange(model, joint, near)
        shown = joint.errors <= ERRORS_MAX
        # both or none: a drive shows their sum and their difference
        shown[[LEFT, RIGHT]] = shown[LEFT] and shown[RIGHT]
        if not shown.any() and not delay.known:
            raise UserError(
                f"this drive shows nothing about the robot: its wheels rolled "
                f"{drive.way * WHEEL_RADIUS:.2f} m, and {int(near.sum())} readings "
                "were near a wall"
            )
        held = np.where(shown, joint.parameters, before)
        after = smooth(
            model, replace(joint, parameters=held), prior, shown, loss=CAUCHY
        )
        nothing = np.zeros(N_PARAMETERS, bool)
        unfitted = smooth(
            model, replace(joint, parameters=before), prior, nothing, loss=CAUCHY
        )
    except LinAlgError:
        raise UserError(
            "no robot explains this drive: --arena or --pose is wrong, or the robot is "
            "not an e-puck"
        ) from None
    return DriveFit(
        calibration=_checked(after.parameters, delay.latency),
        shown=shown,
        errors=joint.errors,
        delay=delay,
        slip=model.slip,
        start=after.poses[0],
        turned=float(np.abs(np.diff(after.poses[:, 2])).sum()),
        n_near=near.sum(axis=0),
        jump=_jump(model, after),
        quantities=(
            motor_steps(drive, known.latency, delay.latency),
            *paths(model, unfitted, after),
            *readings(model, unfitted, after, near),
        ),
    )


def _plan(scene: Scene, control_step: float) -> Plan:
    try:
        return plan_of(scene, SIGHT, control_step)
    except UserError as error:
        # no other robot helps here
        reason = str(error).partition("; ")[0]
        raise UserError(f"{reason}; a fit needs exact outlines") from None


def _likeliest(model: DriveModel, known: np.ndarray) -> tuple[DriveModel, Smoothed]:
    """The drive with all parameters fitted and the likeliest slip."""
    free = np.ones(N_PARAMETERS, bool)
    found = followed(model, known, free)
    best = None
    for slip in SLIPS:
        model = replace(model, slip=slip)
        found = smooth(model, found, Prior(model.drive.start, known), free, loss=CAUCHY)
        if best is None or found.evidence > best[1].evidence:
            best = model, found
    assert best is not None
    return best


def without_spikes(counts: np.ndarray) -> np.ndarray:
    """Counts `(T, 8)` in which NaN stands for saturated readings that no wall gave.

    A robot moves by 13 mm in a control step at most. So a sensor that is saturated at a
    wall sees it near within `REACH` control steps, before or after, too.
    """
    clear = np.where(counts < SATURATED, counts, np.nan)
    padded = np.pad(clear, ((REACH, REACH), (0, 0)), constant_values=np.nan)
    around = sliding_window_view(padded, 2 * REACH + 1, axis=0)
    # where all are saturated or missing, nothing is said
    highest = np.fmax.reduce(around, axis=-1)
    return np.where((counts >= SATURATED) & (highest <= NEAR), np.nan, counts)


def _refuse_strange(model: DriveModel, found: Smoothed, near: np.ndarray) -> None:
    left = model.linearised(found.poses, found.parameters).seen
    # expected and missed counts as well as seen and not expected
    concerned = near | (np.abs(left) > OUTLIER)
    if concerned.any():
        share = float((np.abs(left[concerned]) > OUTLIER).mean())
        if share > STRANGE_MAX:
            raise _strange(share, model.drive)


def _jump(model: DriveModel, found: Smoothed) -> Jump | None:
    """The largest move that wheels do not explain, if it is one.

    Raises:
        UserError: if no robot moves so far.
    """
    path = np.diff(found.poses, axis=0)
    way, turn = model.moved(found.parameters).T
    way = np.abs(np.hypot(path[:, 0], path[:, 1]) - np.abs(way))
    turn = np.abs(path[:, 2] - turn)
    sizes = np.maximum(way / JUMP[0], turn / JUMP[1])
    worst = int(sizes.argmax())
    if sizes[worst] <= 1:
        return None
    jump = Jump(float(model.time[worst]), float(way[worst]), float(turn[worst]))
    if jump.way > JUMP_MAX[0] or jump.turn > JUMP_MAX[1]:
        raise UserError(
            f"expected a drive without jumps; {jump.time:.1f} s after its start the "
            f"robot would have jumped by {1000 * jump.way:.0f} mm and "
            f"{np.degrees(jump.turn):.0f} degrees: --arena or --pose is wrong, or "
            "somebody moved the robot"
        )
    return jump


def _strange(share: float, drive: RecordedDrive) -> UserError:
    x, y, yaw = drive.start
    return UserError(
        f"expected readings that fit the arena from a start at x {x:g} m, y {y:g} m, "
        f"heading {np.degrees(yaw):.0f} degrees; {100 * share:.0f} % of those near a "
        "wall do not fit: --arena or --pose is wrong, or the robot is not an e-puck"
    )


def _checked(parameters: np.ndarray, latency: int) -> Calibration:
    """The calibration of parameters that an e-puck can have.

    Raises:
        UserError: if none can.
    """
    radii = WHEEL_RADIUS * np.exp(parameters[[LEFT, RIGHT]])
    track = float(TRACK * np.exp(parameters[OWN_TRACK]))
    refuse_outside("a track", 1000 * track, (1000 * TRACKS[0], 1000 * TRACKS[1]), " mm")
    gains = np.exp(parameters[GAINS]).tolist()
    for number, gain in enumerate(gains):
        refuse_outside(f"the gain of ps{number}", gain, GAIN_LIMITS, "")
    return Calibration(
        proximity_gains=tuple(gains),
        wheel_radii=checked_wheel_radii(radii.tolist()),
        track=track,
        latency=latency,
        lag=max(float(parameters[LAG]), LAG_MIN),
    )

"""Delay of commands: how late the motors do what they are told.

The counters say what the motors did, the commands what they were to do: one is the
other some time later. The walls play no part in this.
"""

from dataclasses import dataclass

import numpy as np

from epuck_mj.calibrate.recorded_drive import RecordedDrive
from epuck_mj.step.motors import actual_rates

DELAYS = (-0.05, 1.0)
"""Delays that are looked for [s]. Chosen: beyond 1 s no bridge drives."""

RESOLUTION = 0.001
"""Distance of the delays that are tried first [s]."""

SOFT = 5.0
"""Residual from which one counts less than its square [steps]. Chosen: larger ones are
commands that were repeated, or came twice as late as usual."""

SHARE_MAX = 0.1
"""Standard error, in control steps, up to which a delay is known. Chosen."""


@dataclass(frozen=True)
class CommandDelay:
    """How late commands are carried out.

    Attributes:
        delay: from the reading that a command answers to its effect [s].
        error: standard error of it [s]; infinite if commands never changed.
        known: whether the drive shows it.
        latency: whole control steps that are nearest to it.
    """

    delay: float
    error: float
    known: bool
    latency: int


def fit_delay(drive: RecordedDrive) -> CommandDelay:
    """Delay with which the commands come closest to what the counters say."""
    from scipy.optimize import least_squares

    made = np.diff(drive.steps, axis=0)

    def residuals(delay: float) -> np.ndarray:
        return (made - told_steps(drive, float(delay))).ravel()

    tried = np.arange(DELAYS[0], DELAYS[1], RESOLUTION)
    costs = [np.abs(residuals(delay)).sum() for delay in tried]
    rough = float(tried[int(np.argmin(costs))])
    found = least_squares(
        lambda x: residuals(x[0]), [rough], loss="soft_l1", f_scale=SOFT,
        bounds=DELAYS, diff_step=RESOLUTION,
    )  # fmt: skip
    delay = float(found.x[0])
    slope = (residuals(delay + RESOLUTION) - residuals(delay - RESOLUTION)) / (
        2 * RESOLUTION
    )
    left = residuals(delay)
    # whole steps are never closer than this
    spread = max(1.4826 * float(np.median(np.abs(left))), 12**-0.5)
    weight = float(slope @ slope)
    error = spread / weight**0.5 if weight > 0 else float("inf")
    latency = max(0, round(delay / drive.control_step))
    return CommandDelay(delay, error, error <= SHARE_MAX * drive.control_step, latency)


def told_steps(drive: RecordedDrive, delay: float) -> np.ndarray:
    """Steps that motors make between readings with commands that late, `(T, 2)`."""
    rates = actual_rates(drive.rates)
    sums = np.cumsum(rates * np.diff(drive.time)[:, None], axis=0)
    made = np.concatenate([np.zeros((1, 2)), sums])
    return np.diff(
        np.stack(
            [
                np.interp(drive.time - delay, *_ended(drive.time, made[:, i], last))
                for i, last in enumerate(rates[-1])
            ],
            axis=-1,
        ),
        axis=0,
    )


def _ended(
    time: np.ndarray, made: np.ndarray, last: float
) -> tuple[np.ndarray, np.ndarray]:
    """Times and steps with one more of each: the last command goes on."""
    return np.append(time, time[-1] + 1), np.append(made, made[-1] + last)


def lagged_rates(drive: RecordedDrive, delay: float, lag: float) -> np.ndarray:
    """Rates of wheels that follow their motors with a first-order lag, `(T + 1, 2)`.

    Args:
        drive: whose commands were carried out.
        delay: so late [s].
        lag: time constant [s].

    Returns:
        Rates at each reading [steps/s].
    """
    rates, since = actual_rates(drive.rates), drive.time[:-1] + delay
    jumps = np.diff(rates, axis=0, prepend=0.0)
    last = np.searchsorted(since, drive.time, side="right") - 1
    found = np.where(last[:, None] < 0, 0.0, rates[last])
    for back in range(REMEMBERED):
        which = np.maximum(last - back, 0)
        left = np.exp(-np.maximum(drive.time - since[which], 0.0) / lag)
        there = last[:, None] >= back
        found -= np.where(there, jumps[which] * left[:, None], 0.0)
    return found


REMEMBERED = 10
"""Commands that the speed of a wheel still shows: each leaves 0.3 % of what it changed
after six time constants, which are one control step."""

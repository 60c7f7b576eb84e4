"""Guide: instructions and questions to the person who calibrates a robot."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from epuck_mj.calibrate.bench import (
    N_STEPS,
    N_TURNS,
    Bench,
    drive_straight,
    look_around,
    turn_on_the_spot,
    zero,
)
from epuck_mj.calibrate.fitting import (
    SATURATED,
    SIDES,
    SensorFit,
    checked_wheel_radii,
    fit_gains,
    fit_track,
    fit_wheel_radii,
    peaks,
)
from epuck_mj.constants import N_PROXIMITY
from epuck_mj.errors import UserError
from epuck_mj.host.interruption import Interruption
from epuck_mj.host.output import say
from epuck_mj.step.calibration import Calibration
from epuck_mj.step.motors import STEP_ANGLE

CLEARANCES = (0.010, 0.020, 0.030)
"""Clearances from shell to wall [m] at which sensors are good but do not saturate."""

RESIDUAL_MAX = 0.25
"""Residual above which a sensor gets a warning. Chosen."""

LENGTHS = (0.05, 2.0)
"""Plausible lengths of the straight drive [m]; others are asked for again."""

DRIFTS = (-150.0, 150.0)
"""Plausible drifts to the left [mm]: wheels that differ by 5 %."""

MISSES = (-360.0, 360.0)
"""Plausible angles by which a turn misses [degrees]."""


ANSWERS_MAX = 20
"""Wrong answers to one question after which the command ends. Chosen."""


class Person:
    """Person at the robot, who reads instructions and types answers."""

    def __init__(self, ask: Callable[[str], str], interruption: Interruption) -> None:
        """Start without a question asked.

        Args:
            ask: shows a question and gives the answer, as `input` does.
            interruption: what ends the waiting.
        """
        self._ask = ask
        self._interruption = interruption

    def hear(self, text: str) -> None:
        """Print a text; a signal ends this even if the text is not read.

        Raises:
            OutputLost: if it cannot be printed.
        """
        with self._interruption.raising():
            say(text)

    def ready(self, what: str) -> None:
        """Ask for something to be done and wait for Enter."""
        self._answer(f"{what}\nThen press Enter: ")

    def agrees(self, question: str) -> bool:
        """Ask until the answer is yes or no; whether it is yes."""
        for _ in range(ANSWERS_MAX):
            answer = self._answer(f"{question} [y/n]: ").lower()
            if answer in ("y", "yes", "n", "no"):
                return answer.startswith("y")
            self.hear(f"expected y or n, got '{answer}'")
        raise UserError(f"expected y or n, got {ANSWERS_MAX} other answers")

    def number(self, question: str, low: float, high: float) -> float:
        """Ask until the answer is a number within limits; that number."""
        for _ in range(ANSWERS_MAX):
            answer = self._answer(f"{question}: ")
            try:
                value = float(answer.replace(",", "."))
            except ValueError:
                value = math.nan
            if low <= value <= high:
                return value
            self.hear(f"expected a number from {low:g} to {high:g}, got '{answer}'")
        raise UserError(
            f"expected a number from {low:g} to {high:g}, "
            f"got {ANSWERS_MAX} other answers"
        )

    def _answer(self, question: str) -> str:
        try:
            with self._interruption.raising():
                return self._ask(question).strip()
        except EOFError:
            # the question's line is not ended
            self.hear("")
            last = question.splitlines()[-1].strip(": ")
            raise UserError(
                f"expected an answer to '{last}', got the end of the input"
            ) from None


def measure_wheel_radii(
    bench: Bench, person: Person, known: Calibration
) -> Calibration:
    """The calibration with wheel radii measured by a ruler."""
    step_length = STEP_ANGLE * known.wheel_radius
    person.hear(
        "\nWheel radii: the robot drives straight on, you measure where it gets."
    )
    clear = N_STEPS * step_length + 0.15
    person.ready(
        "Mark where its front is, and a line from there to where it points;\n"
        f"leave {clear:.1f} m clear before it, 0.2 m to each side."
    )
    steps = drive_straight(bench, known)
    person.hear(f"It stands. Each wheel made {steps:.0f} steps.")
    forward = person.number("How far did its front get, in metres", *LENGTHS)
    person.hear("By how many millimetres is its front off the line?")
    left = person.number("To the left is above 0, to the right below 0", *DRIFTS)
    radii = fit_wheel_radii(steps, forward, left / 1000, known.track)
    _say_radii(person, radii, known)
    return replace(known, wheel_radii=radii)


def measure_track(bench: Bench, person: Person, known: Calibration) -> Calibration:
    """The calibration with the track measured by a protractor."""
    person.hear(
        f"\nTrack: the robot turns {N_TURNS} times to the left, on the spot;\n"
        "you measure by how much its front misses where it was."
    )
    person.ready("Mark where its front points; leave 5 cm clear around it.")
    steps = turn_on_the_spot(bench, known)
    person.hear(f"It stands. Each wheel made {steps:.0f} steps.")
    person.hear("By how many degrees does its front miss the mark?")
    miss = person.number("Too far is above 0, not far enough is below 0", *MISSES)
    angle = 2 * math.pi * N_TURNS + math.radians(miss)
    mean = known.wheel_radius
    track = fit_track(steps, mean, angle)
    person.hear(f"track {1000 * track:.2f} mm; before {1000 * known.track:.2f}")
    # on the arc that was measured, wheels farther apart differ by more
    wider = track / known.track
    radii = checked_wheel_radii(
        [mean + (radius - mean) * wider for radius in known.wheel_radii]
    )
    if radii != known.wheel_radii:
        _say_radii(person, radii, known)
    return replace(known, track=track, wheel_radii=radii)


def measure_gains(bench: Bench, person: Person, known: Calibration) -> Calibration:
    """The calibration with the measured gains of the proximity sensors."""
    person.hear("\nSensors: the robot turns slowly on the spot, at several distances")
    person.hear("from a flat wall which is 20 cm long or longer.")
    if person.agrees("Set the sensors' zero? They forget it when switched off"):
        person.ready("Leave 20 cm clear around it.")
        zero(bench, known)
        person.hear("The zero is set.")
    rows = []
    for clearance in CLEARANCES:
        person.ready(
            f"Put it to the wall, {1000 * clearance:.0f} mm of air between shell and "
            "wall;\ntake the spacer away, leave 20 cm clear elsewhere."
        )
        rows.append(peaks(*look_around(bench, known)))
        person.hear("It stands.")
    counts = np.array(rows)
    fit = fit_gains(np.array(CLEARANCES), counts)
    person.hear(table(counts, fit))
    return replace(known, proximity_gains=tuple(map(float, fit.gains)))


def table(counts: np.ndarray, fit: SensorFit) -> str:
    """Table of peaks, gains and residuals of the sensors, with warnings.

    Args:
        counts: peaks at CLEARANCES, `(distances, 8)`.
        fit: of these.
    """
    heads = [f"{1000 * clearance:.0f} mm" for clearance in CLEARANCES]
    lines = ["     " + "".join(f"{head:>8}" for head in heads) + "    gain  residual"]
    for number in range(N_PROXIMITY):
        peaks_seen = "".join(f"{count:8.0f}" for count in counts[:, number])
        gain, residual = fit.gains[number], 100 * fit.residuals[number]
        lines.append(f"ps{number}  {peaks_seen}{gain:8.3f}{residual:8.1f} %")
    for number in range(N_PROXIMITY):
        if fit.residuals[number] > RESIDUAL_MAX:
            lines.append(
                f"warning: ps{number} deviates by {100 * fit.residuals[number]:.0f} % "
                "from the curve: check the distances, or its window"
            )
        saturated = ~fit.used[:, number]
        if saturated.any():
            where = ", ".join(np.array(heads)[saturated])
            lines.append(
                f"warning: ps{number} is saturated ({SATURATED} counts and more) at "
                f"{where}: left out"
            )
    return "\n".join(lines)


def _say_radii(person: Person, radii: tuple[float, ...], known: Calibration) -> None:
    for name, radius, before in zip(SIDES, radii, known.wheel_radii, strict=True):
        person.hear(
            f"{name} wheel radius {1000 * radius:.2f} mm; before {1000 * before:.2f}"
        )


STEPS = {
    "straight": measure_wheel_radii,
    "turn": measure_track,
    "sensors": measure_gains,
}
"""Steps of a calibration, in the order in which each helps the next."""

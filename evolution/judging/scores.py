"""Scores of champions, as in their files.

`read` and `read_champion` read scores and refuse invalid ones. `to_dict` gives the
known scores as plain values.
"""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import BaseModel, Field, ValidationError

from epuck_mj.policies.file import ControllerFile, load_controller
from epuck_mj.scene.model_files import is_on_wheels
from epuck_mj.step.fitness import of_most
from evolution.settings.config_fields import within
from evolution.settings.file_fields import damaged

Score = Annotated[float, within("score")]

Share = Annotated[float, within("share")]


class _Record(BaseModel, frozen=True, allow_inf_nan=False):
    """Record that is read from a file and written to one."""

    @classmethod
    def read(cls, fields: Mapping[str, Any], path: Path) -> Self:
        """Read the record from fields of the file at `path`; ignore unknown keys.

        Raises:
            UserError: naming the first value that is missing or no score.
        """
        try:
            return cls.model_validate(fields)
        except ValidationError as error:
            raise damaged(path, error) from None

    def to_dict(self) -> dict[str, Any]:
        """The known values, in the order of the attributes."""
        return self.model_dump(exclude_unset=True)


class HeldOut(_Record, frozen=True):
    """Test of a controller on `starts` held-out starts.

    Older files know less: there, numbers are nan and mappings empty.

    Attributes:
        mean: fitness over the starts.
        standard_deviation: of the fitness of a start.
        interval: bootstrap 95 % confidence bounds of the mean.
        worst: mean of the worst 5 % of the starts.
        crash_rate: share of the trials that ended in a crash.
        collisions_per_minute: crashes per minute lived.
        starts: how many there were, 2 or more: one has no spread.
        behaviour: share of the trials by behaviour class.
        metrics: mean of each of `trials.metrics.Behaviour` over the trials that have
            it, None if none has.
    """

    mean: Score
    standard_deviation: Score = math.nan
    interval: tuple[Score, Score] = (math.nan, math.nan)
    worst: Score = math.nan
    crash_rate: Share
    collisions_per_minute: Score = math.nan
    starts: Annotated[int, within("starts")]
    behaviour: Mapping[str, Share] = {}
    metrics: Mapping[str, Score | None] = {}

    @property
    def following(self) -> float:
        """Share of the trials that followed walls, hugging or not; nan if unknown."""
        shares = self.behaviour
        follows = shares.get("wall follower", 0.0) + shares.get("hugger", 0.0)
        return follows if shares else math.nan

    @property
    def keeping(self) -> float:
        """Share of the trials that followed walls without hugging; nan if unknown."""
        return self.behaviour.get("wall follower", 0.0) if self.behaviour else math.nan

    @property
    def clearance(self) -> float:
        """Mean clearance near walls [m]; nan if unknown, or never near one."""
        return self._metric("clearance_mean")

    @property
    def whole_laps(self) -> float:
        """Share of the trials with a whole lap; nan if unknown."""
        return self._metric("success")

    def _metric(self, name: str) -> float:
        value = self.metrics.get(name)
        return math.nan if value is None else value


class BestStored(_Record, frozen=True):
    """The individual with the highest stored fitness of a run.

    Attributes:
        fitness: that fitness.
        held_out: its mean on the test starts, on ideal robots.
        robot: on which it evolved and was tested; empty if unknown.
    """

    fitness: Score
    held_out: Score
    robot: str = ""


class Scores(_Record, frozen=True):
    """Scores of a champion.

    Attributes:
        stored: fitness that evolution has for it, of its own trials.
        validation: mean on the validation starts, which chose it; nan if unknown.
        held_out: tests on the test starts by robot; one is a shipped one on wheels.
        best_stored: individual of the run's highest stored fitness; None if unknown.
        held_out_as_evolved: tests with the disturbances it evolved with, by robot.
    """

    stored: Score
    validation: Score = math.nan
    held_out: Mapping[str, HeldOut] = Field(min_length=1)
    best_stored: BestStored | None = None
    held_out_as_evolved: Mapping[str, HeldOut] = {}

    def in_lines(self, most: float | None) -> str:
        """Lines with the champion's held-out and stored fitness, and why these differ.

        Args:
            most: fitness that a trial can reach; None if that is not known.
        """
        (first, test), *others = _wheels_first(self.held_out).items()
        lines = [
            f"The champion earns {of_most(test.mean, most)}: the mean of "
            f"{test.starts:,} fresh starts on {first}; {test.crash_rate:.0%} of the "
            "trials end in a crash"
        ]
        if others:
            lines.append(f"On {_in_words(dict(others))}")
        if self.held_out_as_evolved:
            disturbed = _in_words(self.held_out_as_evolved)
            lines.append(f"With the disturbances it evolved with: {disturbed}")
        lines.append(
            f"Evolution stored {self.stored:.1f} for it, from the few starts of its "
            "own trials, which may have been easy ones"
        )
        best = self.best_stored
        if best is not None and best.fitness != self.stored:
            lines.append(
                f"The highest fitness that evolution stored was {best.fitness:.1f}, of "
                f"an individual that earns {best.held_out:.1f} on fresh starts"
            )
        return "\n".join(lines)

    @property
    def in_short(self) -> str:
        """Part of a line with held-out fitness on each robot and stored fitness."""
        tests = _in_words(_wheels_first(self.held_out))
        return f"held-out {tests}; stored {self.stored:.1f}"


def _wheels_first(tests: Mapping[str, HeldOut]) -> dict[str, HeldOut]:
    """The tests by robot: what is reported first."""
    return dict(sorted(tests.items(), key=lambda test: not is_on_wheels(test[0])))


def _in_words(tests: Mapping[str, HeldOut]) -> str:
    return ", ".join(
        f"{robot} {test.mean:.1f} ({test.crash_rate:.0%} crash)"
        for robot, test in tests.items()
    )


def read_champion(path: Path) -> tuple[ControllerFile, Scores]:
    """The champion in a file, and its scores.

    Raises:
        UserError: if it cannot be read, or is damaged.
    """
    champion = load_controller(path)
    return champion, Scores.read(champion.scores, path)


class KnownScores(Scores, frozen=True):
    """Scores of any policy, of which each may be unknown."""

    stored: Score = math.nan
    held_out: Mapping[str, HeldOut] = {}

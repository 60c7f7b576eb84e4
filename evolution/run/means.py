"""Means: engine, threads and racing of a run, which change none of its results."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from evolution.run.generation_loop import EngineMaker


@dataclass(frozen=True)
class Means:
    """Engine, threads and racing of a run, which change none of its results.

    Attributes:
        engine: one of `generation_loop.ENGINES`, or a maker of engines.
        threads: that step the robots; 0 is one per core.
        racing: break off individuals that can only lose.
    """

    engine: "str | EngineMaker" = "batch"
    threads: int = 0
    racing: bool = True

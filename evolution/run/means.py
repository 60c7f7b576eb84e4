"""Means: engine, threads and racing of a run, which change none of its results."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from evolution.judging.evaluation import Engine


@dataclass(frozen=True)
class Means:
    """Engine, threads and racing of a run, which change none of its results.

    Attributes:
        engine: one of `generation_loop.ENGINES`, or an engine whose `str` is what
            the provenance calls it.
        threads: that step the robots; 0 is one per core.
        racing: break off individuals that can only lose.
    """

    engine: "str | Engine" = "batch"
    threads: int = 0
    racing: bool = True

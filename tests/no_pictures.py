"""Runs that draw nothing: pictures take longer than the evolution of a test."""

from typing import Any

import pytest

from evolution.run import results
from evolution.run.directory import RunDirectory

INSTEAD = "lambda _, run, *__: [each.write_bytes(b'-') for each in run.pictures]"
"""The same in the code of a process, for `results._draw_fitness` and `results._show`.

A finished run has its pictures, so something stands in for them.
"""


def _stand_in(evolution: Any, directory: RunDirectory, *more: Any) -> None:
    for path in directory.pictures:
        path.write_bytes(b"-")


def draw_nothing(patch: pytest.MonkeyPatch) -> None:
    """Let runs of this process put something else in the place of their pictures."""
    patch.setattr(results, "_draw_fitness", _stand_in)
    patch.setattr(results, "_show", _stand_in)

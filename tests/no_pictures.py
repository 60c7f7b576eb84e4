"""Runs and drives that draw nothing: pictures take longer than what a test is about."""

import sys
from types import SimpleNamespace
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


BRIDGE = """
import sys
from types import SimpleNamespace
from epuck_mj.host.command_line import main

show_nothing = SimpleNamespace(save_pictures=lambda *_: [])
sys.modules["epuck_mj.bridge.drive.pictures"] = show_nothing
from epuck_mj.bridge.__main__ import bridge
main(bridge)
"""
"""Code of a bridge without pictures, which take seconds to load."""


def show_nothing(patch: pytest.MonkeyPatch) -> None:
    """Let bridges of this process write no pictures."""
    instead = SimpleNamespace(save_pictures=lambda *_: [])
    patch.setitem(sys.modules, "epuck_mj.bridge.drive.pictures", instead)

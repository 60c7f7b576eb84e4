"""Shared by all tests: both shipped robots in the paper's arena."""

import os
import signal

# rerun: no analytics, and warnings about bad data are errors
os.environ["CI"] = "1"
os.environ["RERUN_STRICT"] = "1"

import pytest

from epuck_mj.model import Scene, load_scene

# ignored where tests run in the background of a script, and by all that they start
signal.signal(signal.SIGINT, signal.default_int_handler)

ROBOTS = ("epuck", "epuck_planar")


@pytest.fixture(scope="session", params=ROBOTS)
def scene(request) -> Scene:
    """Each shipped robot, in turn."""
    return load_scene(request.param, "arena")

"""Python processes that tests start, which do not outlive them."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import pytest

PATIENCE = 600.0
"""Whatever takes longer [s] hangs, on however slow and busy a machine."""


def forget(patch: pytest.MonkeyPatch, module: str) -> None:
    """Let a command's module be run in this process as in a fresh one."""
    for name in (module, f"{module}.__main__"):
        file = sys.modules.get(name)
        if file is not None and not hasattr(file, "__path__"):
            patch.delitem(sys.modules, name)


@contextmanager
def python_process(
    *arguments: str, **options: Any
) -> Iterator["subprocess.Popen[str]"]:
    """A python process; neither it nor its children outlive the block.

    Its streams are pipes of text but for stdin, which is empty, unless `options` of
    `subprocess.Popen` say otherwise.
    """
    defaults = {
        "stdin": subprocess.DEVNULL,
        "stdout": subprocess.PIPE,
        "stderr": subprocess.PIPE,
        "text": True,
        "start_new_session": True,
    }
    process = subprocess.Popen([sys.executable, *arguments], **(defaults | options))
    try:
        yield process
    finally:
        # it may have ended and left children
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate(timeout=PATIENCE)

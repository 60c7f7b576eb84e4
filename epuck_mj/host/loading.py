"""Loading of a command's modules, which takes seconds and can be interrupted.

`command_line.main` comes later: until then Ctrl-C and a lack of memory would print a
traceback. Nothing is written and nobody drives yet.
"""

import os
import signal
import sys
from pathlib import Path
from types import TracebackType

from epuck_mj.host.hardship import hardship
from epuck_mj.host.output import complain

PACKAGES = ("epuck_mj", "evolution")
SCRIPT = "epuck-mj"

INTERRUPTED = 130
"""Exit status after Ctrl-C."""


def is_command() -> bool:
    """Whether this process was started for a command of this project.

    Asked while the first of its packages is imported.
    """
    # python's own sign, as long as it looks for the module of -m
    if sys.argv[:1] != ["-m"]:
        return Path(sys.argv[0]).stem == SCRIPT if sys.argv else False
    words = (word.removeprefix("-m") for word in sys.orig_argv[1:])
    return any(word.partition(".")[0] in PACKAGES for word in words)


def prepare() -> None:
    """In a command: let errors and signals while loading show no traceback."""
    if not is_command():
        return
    set_environment()
    # a file must not get the number of a closed standard stream
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    end_at_interrupts()
    sys.excepthook = _report


def set_environment() -> None:
    """Tell libraries how to work in a command, where the user has not told them."""
    # commands make OpenGL themselves, if they draw: see `show.render`
    os.environ.setdefault("MUJOCO_GL", "disabled")
    # threads for matrices of 40 by 40 wait for each other, for most of a CMA-ES
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def end_at_interrupts() -> None:
    """Let Ctrl-C end the process at once, unless it is ignored or handled."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _end)


def raise_interrupts() -> None:
    """Let Ctrl-C raise again what Python raises."""
    if signal.getsignal(signal.SIGINT) is _end:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _end(signum: int, frame: object) -> None:
    os._exit(INTERRUPTED)


def _report(
    kind: type[BaseException], error: BaseException, where: TracebackType | None
) -> None:
    """Say what the computer lacks in one line; show all else with its traceback."""
    line = hardship(error)
    if line is None:
        sys.__excepthook__(kind, error, where)
        return
    complain(f"error: {line}")
    os._exit(2)

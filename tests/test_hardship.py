"""What the computer lacks is one line and status 2, Ctrl-C is quiet: no traceback."""

import errno
import os
import signal
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest

from epuck_mj.errors import UserError
from epuck_mj.host.command_line import main
from epuck_mj.host.hardship import hardship
from tests.processes import PATIENCE

ROOT = Path(__file__).parent.parent
posix = pytest.mark.skipif(os.name != "posix", reason="file descriptors and signals")

SHORT = ("evolution.verify", "no/such/run")
"""A command that has something to complain of, quickly."""

FULL = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "a.rrd")
NO_FILES = OSError(errno.EMFILE, os.strerror(errno.EMFILE))
NAME = UnicodeEncodeError(
    "utf-8", "the file \udcff.xml", 9, 10, "surrogates not allowed"
)


def big_array():
    np.zeros(10**18)


def small_data():
    raise mujoco.FatalError("Could not allocate memory")


def raised_by(function) -> Exception:
    with pytest.raises(Exception) as caught:
        function()
    return caught.value


LACKS = {
    "a full disk": (FULL, "'a.rrd': No space left on device"),
    "open files": (NO_FILES, "Too many open files"),
    "numpy": (raised_by(big_array), "not enough memory: Unable to allocate"),
    "nothing said": (MemoryError(), "not enough memory"),
    "MuJoCo": (raised_by(small_data), "not enough memory: Could not allocate memory"),
    "MuJoCo's compiler": (
        ValueError("Error: engine error: Could not allocate memory"),
        "not enough memory: Error: engine error",
    ),
    "MuJoCo's batch": (ValueError("std::bad_alloc"), "not enough memory: std::bad"),
    "a library": (
        ImportError("_core.so: failed to map segment from shared object"),
        "not enough memory: _core.so",
    ),
    "threads": (RuntimeError("can't start new thread"), "not enough memory: can't"),
    "ENOMEM": (OSError(errno.ENOMEM, "Cannot allocate memory"), "not enough memory: "),
    "a name": (NAME, r"cannot be written as utf-8: '\udcff'"),
    "several lines": (OSError("first\n  second\n"), "first second"),
}


def ending(run, capsys) -> tuple[object, str, str]:
    """Status of a command line in this process, and what it printed."""
    with pytest.raises(SystemExit) as end:
        main(run)
    return end.value.code, *capsys.readouterr()


def raising(error: BaseException):
    def run(argv):
        raise error

    return run


@pytest.mark.parametrize("what", LACKS)
def test_what_the_computer_lacks_is_one_line(what, handlers, capsys):
    error, line = LACKS[what]
    assert str(hardship(error)).startswith(line)
    status, out, said = ending(raising(error), capsys)
    assert (status, out) == (2, "")
    assert said.startswith(f"error: {line}")
    assert said.count("\n") == 1


@pytest.mark.parametrize(
    "error", [TypeError("x"), ValueError("x"), RuntimeError("x"), ImportError("x")]
)
def test_errors_of_the_program_are_not_hidden(error, handlers):
    assert hardship(error) is None
    with pytest.raises(type(error)):
        main(raising(error))


def test_ctrl_c_in_a_library_that_loads_is_quiet(handlers, capsys):
    """MuJoCo says only that it could not be initialised."""

    def interrupted(argv):
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt as error:
            raise ImportError("initialization failed") from error

    assert ending(interrupted, capsys) == (130, "", "")
    assert ending(raising(KeyboardInterrupt()), capsys) == (130, "", "")


def test_what_the_user_can_put_right(handlers, capsys):
    assert ending(raising(UserError("so")), capsys) == (2, "", "error: so\n")


# as processes


def command(*arguments: str, shell: str = "", **variables: str):
    """A command of this project, with something typed behind it in a shell."""
    line = f'exec "$0" -m "$@" {shell}'
    return subprocess.run(
        ["sh", "-c", line, sys.executable, *arguments],
        cwd=ROOT,
        env=os.environ | variables,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )


@posix
@pytest.mark.parametrize(
    ("arguments", "shell", "status", "error"),
    [
        (("evolution",), ">/dev/full", 2, "error: No space left on device\n"),
        (("evolution.run", "-h"), ">/dev/full", 2, "error: No space left on device\n"),
        (("evolution",), ">&-", 2, "error: standard output: Bad file descriptor\n"),
        (SHORT, "2>/dev/full", 2, ""),
        (SHORT, "2>&-", 2, ""),
        (("evolution",), "2>&-", 0, ""),
    ],
)
def test_streams_that_take_nothing(arguments, shell, status, error):
    if "/dev/full" in shell and not Path("/dev/full").exists():
        pytest.skip("no /dev/full")
    process = command(*arguments, shell=shell)
    assert (process.returncode, process.stderr) == (status, error)


@posix
def test_a_file_never_gets_the_number_of_a_closed_stream(tmp_path):
    """What C libraries print would end up in it."""
    code = (
        "import sys; sys.argv[0] = '-m'; sys.orig_argv = ['', '-m', 'evolution']\n"
        "import epuck_mj; file = open(sys.argv[1], 'w')\n"
        "file.write(str(file.fileno()))\n"
    )
    file = tmp_path / "number"
    line = 'exec "$0" -c "$@" <&- >&- 2>&-'
    arguments = ["sh", "-c", line, sys.executable, code, file]
    subprocess.run(arguments, cwd=ROOT, check=True, timeout=PATIENCE)
    assert int(file.read_text()) > 2


@posix
def test_any_name_can_be_shown_on_any_terminal():
    ascii_only = {"PYTHONIOENCODING": "ascii", "LC_ALL": "C"}
    process = command("evolution.verify", "café", **ascii_only)
    assert process.returncode == 2
    assert process.stderr.startswith(r"error: no champion in 'caf\xe9'")
    process = command("evolution.gap", "-h", **ascii_only)
    assert (process.returncode, process.stderr) == (0, "")


@posix
@pytest.mark.parametrize(
    ("module", "status", "error"),
    [
        ("import signal; signal.raise_signal(signal.SIGINT)", 130, ""),
        ("raise MemoryError", 2, "error: not enough memory\n"),
        (
            "raise ImportError('a.so: failed to map segment')",
            2,
            "error: not enough memory: a.so: failed to map segment\n",
        ),
        ("raise ImportError('other')", 1, None),
    ],
)
def test_while_modules_load(module, status, error, tmp_path):
    (tmp_path / "tyro.py").write_text(module)
    path = os.pathsep.join([str(tmp_path), str(ROOT)])
    process = command("evolution.run", PYTHONPATH=path)
    assert process.returncode == status, process.stderr
    if error is None:
        assert "Traceback" in process.stderr
    else:
        assert process.stderr == error


@posix
def test_who_imports_the_library_keeps_the_handler():
    code = (
        "import signal, sys, epuck_mj, evolution\n"
        "assert signal.getsignal(signal.SIGINT) is signal.default_int_handler\n"
        "assert sys.excepthook is sys.__excepthook__\n"
    )
    arguments = [sys.executable, "-c", code]
    subprocess.run(arguments, cwd=ROOT, check=True, timeout=PATIENCE)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler

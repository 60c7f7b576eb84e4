"""Command lines: parsing, and one clear line with exit status 2 for bad input."""

import contextlib
import io
import math
import re
import shlex
import signal
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import tyro
from tyro.constructors import PrimitiveConstructorSpec

from epuck_mj.errors import UserError
from epuck_mj.host import loading
from epuck_mj.host.hardship import hardship
from epuck_mj.host.interruption import follows, not_dropped, send_soon
from epuck_mj.host.limits import check_flag
from epuck_mj.host.output import (
    OUTPUT_LOST,
    OutputLost,
    complain,
    give_up_streams,
    standard_streams,
)

Options = TypeVar("Options")


def _no_flag(words: list[str]) -> Any:
    raise ValueError("no flag sets this: write an experiment of your own")


PART = PrimitiveConstructorSpec(
    nargs=1,
    metavar="{fixed}",
    instance_from_str=_no_flag,
    is_instance=lambda value: True,
    str_from_instance=lambda value: ["as in the experiment"],
)
"""Annotation of a part with parameters of its own, which only a file can set."""


def word(metavar: str) -> Any:
    """The marker of a flag whose help shows that word for its value."""
    return tyro.conf.arg(metavar=metavar)


def pose_flag(
    given: tuple[float, float, float] | None,
) -> tuple[float, float, float] | None:
    """The pose of --pose: x and y [m], heading [rad]; None if none was given.

    Args:
        given: x and y [m] and heading [degrees].

    Raises:
        UserError: if a number is not finite.
    """
    if given is None:
        return None
    if not all(map(math.isfinite, given)):
        raise UserError(f"expected --pose of finite numbers, got {given}")
    x, y, degrees = given
    return x, y, math.radians(degrees)


def parse(
    kind: type[Options],
    prog: str,
    argv: Sequence[str],
    default: Options | None = None,
    examples: Sequence[str] = (),
) -> Options:
    """Parse `argv` into options whose flags are the fields of `kind`.

    Args:
        kind: dataclass of the options.
        prog: how a person calls the program.
        argv: what was typed behind it.
        default: options that flags change; None takes the defaults of `kind`.
        examples: command lines that the help ends with.

    Raises:
        UserError: if the arguments cannot be understood.
        SystemExit: after printing help.
    """
    box = io.StringIO()
    try:
        with contextlib.redirect_stderr(box):
            return tyro.cli(
                kind,
                default=tyro.MISSING_NONPROP if default is None else default,
                prog=prog,
                args=list(argv),
                config=(
                    tyro.conf.OmitArgPrefixes,
                    tyro.conf.AvoidSubcommands,
                    tyro.conf.FlagCreatePairsOff,
                ),
            )
    except SystemExit as error:
        if error.code:
            raise UserError(_in_one_line(box.getvalue(), prog)) from None
        if examples:
            print("examples:", *examples, sep="\n  ")
        raise


def _in_one_line(text: str, prog: str) -> str:
    """The message of tyro's box, with the flag that may have been meant."""
    message = _unboxed(text)
    if message.startswith("Unrecognized options"):
        unknown = message.partition(": ")[2].replace(",", "")
        if not unknown.startswith("-"):
            first = unknown.split()[0]
            return f"expected an option, got '{first}'; see {prog} --help"
        meant = re.search(r"Perhaps you meant:\W+(--[\w-]+)", text)
        hint = f"did you mean {meant[1]}?" if meant else f"see {prog} --help"
        return f"unknown option {unknown}; {hint}"
    if message.startswith("Missing from"):
        # each with its name first
        missing = message.partition(": ")[2].split("(required)")[:-1]
        names = ", ".join(text.split()[0] for text in missing)
        return f"expected {names}, got none; see {prog} --help"
    return message


def _unboxed(text: str) -> str:
    """Text of tyro's box of several lines on one line, without its extras."""
    drawn = "│" in text
    lines = [
        line.strip("│ ") for line in text.splitlines() if line[:1] not in ("╭", "╰")
    ]
    rules = [i for i, line in enumerate(lines) if line and set(line) <= {"─", "-"}]
    # without Unicode there is no box, and the title has a rule as well
    first = 0 if drawn or not rules else rules.pop(0) + 1
    # what follows the next rule is help
    message = " ".join(filter(None, lines[first : rules[0] if rules else None]))
    for pattern, replacement in EXTRAS:
        message = re.sub(pattern, replacement, message)
    return message


EXTRAS = (
    (r"^Error parsing config\S*: ", ""),
    (r"^\d+ validation errors? for \w+ ", ""),
    (r"^Value error, ", ""),
    # of all keys together
    (r" ?\[type=value_error, input_value=\{.*?, input_type=dict\]", ""),
    (r" ?\[type=\w+, input_value=(.*?), input_type=\w+\]", r", got \1"),
    (r" ?For further information visit \S+", ""),
    # of one key each
    (r"(^| )(\w+) Value error, ", r"; \2: "),
    (r"^; ", ""),
    (
        r"^Error parsing (\S+): invalid literal for int\(\) with base 10: ",
        r"\1: expected a whole number, got ",
    ),
    (
        r"^Error parsing (\S+): could not convert string to float: ",
        r"\1: expected a number, got ",
    ),
    (r"^(\w+) Input should be ", r"\1: expected "),
)
"""Texts that tyro and pydantic add for programmers, and their replacements."""


def main(run: Callable[[Sequence[str]], int]) -> None:
    """Run a command line and leave the process with its exit status.

    `run` may raise `UserError` for anything that the user can put right. What the
    computer lacks is one line as well; only errors of the program show a traceback.
    """
    loading.raise_interrupts()
    try:
        status = _status(run)
    except OutputLost as error:
        complain(f"error: {error}")
        status = OUTPUT_LOST
    except UserError as error:
        complain(f"error: {error}")
        status = 2
    except KeyboardInterrupt:
        status = loading.INTERRUPTED
    except BrokenPipeError:
        status = 1
    except Exception as error:
        line = hardship(error)
        # libraries that are interrupted while they load say that they failed
        if follows(error, KeyboardInterrupt):
            status = loading.INTERRUPTED
        elif line is None:
            raise
        else:
            complain(f"error: {line}")
            status = 2
    give_up_streams()
    # nothing has to be cleaned up
    loading.end_at_interrupts()
    sys.exit(status)


def _status(run: Callable[[Sequence[str]], int]) -> int | str | None:
    """The exit status of a command line whose output has left the process."""
    standard_streams()
    try:
        with not_dropped(KeyboardInterrupt, lambda: send_soon(signal.SIGINT)):
            status = run(sys.argv[1:])
    except SystemExit as end:
        # after help
        status = end.code
    # a full disk may show only here
    sys.stdout.flush()
    return status


def shell_command(module: str, *arguments: str | Path) -> str:
    """The shell command that runs a module, as one would type it here."""
    python = Path(sys.executable)
    if python.is_relative_to(Path.cwd()):
        python = python.relative_to(Path.cwd())
    else:
        python = Path("python")
    return shlex.join([str(python), "-m", module, *map(str, arguments)])


def check_ending(flag: str, path: Path | None, ending: str) -> None:
    """Refuse a file of another kind than a command writes, such as one of a run.

    Args:
        flag: its name.
        path: of the file, if one is asked for.
        ending: that its name has to have.

    Raises:
        UserError: for another ending.
    """
    if path is not None and path.suffix.lower() != ending:
        raise UserError(
            f"--{flag}: expected a name that ends in {ending}, got '{path}'"
        )


def check_threads(threads: int) -> None:
    """Refuse negative or too large numbers of threads; 0 stands for one per core.

    Raises:
        UserError: for such a number.
    """
    check_flag("threads", threads)

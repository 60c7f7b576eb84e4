"""What all command lines share: one clear line and exit status 2 for bad input."""

import contextlib
import io
import os
import re
import shlex
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

import tyro

from epuck_mj.errors import UserError

Options = TypeVar("Options")


def parse(default: Options, prog: str, argv: Sequence[str]) -> Options:
    """The options in `argv`, on top of `default`, whose fields are the flags.

    Raises:
        UserError: if the arguments cannot be understood.
        SystemExit: after printing help.
    """
    box = io.StringIO()
    try:
        with contextlib.redirect_stderr(box):
            return tyro.cli(
                type(default),
                default=default,
                prog=prog,
                args=list(argv),
                config=(
                    tyro.conf.OmitArgPrefixes,
                    tyro.conf.AvoidSubcommands,
                    tyro.conf.FlagCreatePairsOff,
                ),
            )
    except SystemExit as error:
        if not error.code:
            raise
        raise UserError(_unboxed(box.getvalue())) from None


def _unboxed(text: str) -> str:
    """The message of tyro's box of several lines, on one and without its extras."""
    lines = [line.strip("│ ") for line in text.splitlines() if line.startswith("│")]
    # what follows the first rule is help
    rules = [i for i, line in enumerate(lines) if set(line) == {"─"}]
    message = " ".join(lines[: rules[0]] if rules else lines)
    for pattern, replacement in EXTRAS:
        message = re.sub(pattern, replacement, message)
    return message


EXTRAS = (
    (r"^Error parsing config\S*: ", ""),
    (r"^\d+ validation errors? for \w+ ", ""),
    (r" ?\[type=\w+, input_value=(.*?), input_type=\w+\]", r", got \1"),
    (r" ?For further information visit \S+", ""),
)
"""What pydantic adds for programmers, and what stands for it."""


def main(run: Callable[[Sequence[str]], int]) -> None:
    """Run a command line and leave the process with its exit status."""
    try:
        status = run(sys.argv[1:])
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        status = 2
    except BrokenPipeError:
        # whoever reads has gone; python's own flush at exit must not complain
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        status = 1
    sys.exit(status)


def command(module: str, *arguments: str | Path) -> str:
    """The line that runs a module of ours, as a person would type it here."""
    python = Path(sys.executable)
    if python.is_relative_to(Path.cwd()):
        python = python.relative_to(Path.cwd())
    else:
        python = Path("python")
    return shlex.join([str(python), "-m", module, *map(str, arguments)])

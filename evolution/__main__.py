"""All commands: `python -m evolution`, or `epuck-mj COMMAND ...` once installed."""

import runpy
import sys
from collections.abc import Sequence

from epuck_mj.__main__ import COMMANDS as ROBOT_COMMANDS
from epuck_mj.__main__ import listing
from epuck_mj.errors import UserError
from epuck_mj.host.command_line import main

COMMANDS = {
    "evolution.run": "evolve a controller, choose its champion, test it",
    "evolution.replay": "watch champions in the rerun viewer, on a page, as video",
    "evolution.evaluate": "test champions on new starts, in any arena",
    "evolution.study": "do many runs: every experiment with every seed",
    "evolution.study.pack": "put the runs of an older study into its tables",
    "evolution.report": "write tables and figures of a study",
    "evolution.margins": "test champions on robots that differ in one number",
    "evolution.hybrids": "write a page about evolution that learns",
    "evolution.variations": "write a page about variations of the algorithms",
    "evolution.gap": "test champions in a hundred other worlds",
    "evolution.export": "write the controller file of a run in a study's tables",
    "evolution.reproduce": "repeat the paper's comparison in one command",
    "evolution.verify": "test shipped champions again and compare the scores",
}
"""Modules that are commands, and what each does."""


def script() -> None:
    """Run `epuck-mj COMMAND ...`: the command by the last part of its module's name."""
    main(_command)


def _command(argv: Sequence[str]) -> int:
    """Run a command, or show all commands; return the exit status.

    Raises:
        UserError: if there is no such command.
        SystemExit: with the exit status of the command.
    """
    modules = {
        module.rpartition(".")[2]: module for module in COMMANDS | ROBOT_COMMANDS
    }
    if not argv or argv[0] in ("-h", "--help"):
        show(argv)
        print(f"epuck-mj COMMAND is the same for: {', '.join(modules)}")
        return 0
    name = sys.argv.pop(1)
    if name not in modules:
        raise UserError(f"no command '{name}'; available: {', '.join(modules)}")
    runpy.run_module(modules[name], run_name="__main__", alter_sys=True)
    return 0


def show(argv: Sequence[str]) -> int:
    """Show the commands and return the exit status."""
    print(listing(COMMANDS | ROBOT_COMMANDS))
    return 0


if __name__ == "__main__":
    main(show)

"""All commands: `python -m evolution`, or `epuck-mj COMMAND ...` once installed."""

import runpy
import sys

from epuck_mj.__main__ import COMMANDS as ROBOT_COMMANDS
from epuck_mj.__main__ import listing

COMMANDS = {
    "evolution.run": "evolve a controller, choose its champion, test it",
    "evolution.replay": "watch champions in the rerun viewer, on a page, as video",
    "evolution.evaluate": "test champions on new starts, in any arena",
    "evolution.study": "do many runs: every experiment with every seed",
    "evolution.report": "write tables and figures of a study",
    "evolution.gap": "test champions in a hundred other worlds",
    "evolution.reproduce": "repeat the paper's comparison in one command",
    "evolution.verify": "test shipped champions again and compare the scores",
}
"""Modules that are commands, and what each does."""


def script() -> None:
    """Run `epuck-mj COMMAND ...`: the command by the last part of its module's name."""
    modules = {
        module.rpartition(".")[2]: module for module in COMMANDS | ROBOT_COMMANDS
    }
    if len(sys.argv) < 2 or sys.argv[1] in ("-h", "--help"):
        print(listing(COMMANDS | ROBOT_COMMANDS))
        print(f"epuck-mj COMMAND is the same for: {', '.join(modules)}")
        return
    name = sys.argv.pop(1)
    if name not in modules:
        available = ", ".join(modules)
        print(f"error: no command '{name}'; available: {available}", file=sys.stderr)
        sys.exit(2)
    runpy.run_module(modules[name], run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    print(listing(COMMANDS | ROBOT_COMMANDS))

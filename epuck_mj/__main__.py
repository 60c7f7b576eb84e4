"""The commands of this package: `python -m epuck_mj`."""

from collections.abc import Sequence

from epuck_mj.host.command_line import main

COMMANDS = {
    "epuck_mj.check": "list what is in an arena and what is wrong with it",
    "epuck_mj.view": "watch a champion in MuJoCo's own viewer",
    "epuck_mj.bridge": "drive a real e-puck or the emulated one",
    "epuck_mj.bridge.fake": "emulate an e-puck on a serial port",
    "epuck_mj.calibrate": "measure one robot, or fit it to its log",
}
"""Modules that are commands, and what each does."""


def listing(commands: dict[str, str]) -> str:
    """A line for each command, and how to learn more."""
    width = max(map(len, commands)) + len("python -m ")
    lines = [
        f"{'python -m ' + name:{width}}  {text}" for name, text in commands.items()
    ]
    return "\n".join([*lines, "", "Each command explains its options with --help."])


def show(argv: Sequence[str]) -> int:
    """Show the commands and return the exit status."""
    print(listing(COMMANDS))
    return 0


if __name__ == "__main__":
    main(show)

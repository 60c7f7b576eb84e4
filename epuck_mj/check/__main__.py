"""Check an arena: `python -m epuck_mj.check ARENA`.

Exit status 0 if the arena is usable, 1 if errors were found in it, and 2, as for all
command lines here, if there is no arena to look at: bad options, no file, no text.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from epuck_mj.host.command_line import check_ending, main, parse, word
from epuck_mj.host.files import check_writable
from epuck_mj.scene.model_files import KINEMATIC_ROBOT, WHEELED_ROBOT

EXAMPLES = (
    "python -m epuck_mj.check my.xml",
    "python -m epuck_mj.check my.xml --picture my.png",
)


@dataclass(frozen=True)
class Options:
    """Check an arena: walls, free space, sensors, contacts and speed.

    The exit status is 1 if the arena cannot be used.
    """

    arena: tyro.conf.Positional[Annotated[str, word("ARENA")]]
    """name of a shipped arena, or path of an MJCF file"""
    robot: Annotated[str | None, word("ROBOT")] = None
    """name of a shipped robot, or path of an MJCF file; both shipped ones by default"""
    picture: Annotated[Path | None, word("FILE")] = None
    """PNG file to draw the walls and the free space to, seen from above"""


def check(argv: Sequence[str]) -> int:
    """Check an arena, print the findings, and return the exit status."""
    options = parse(Options, "python -m epuck_mj.check", argv, examples=EXAMPLES)
    check_ending("picture", options.picture, ".png")
    if options.picture is not None:
        check_writable(options.picture)
    # slow to import: after the checks of the command line
    from epuck_mj.check import report
    from epuck_mj.check.arena import check_arena

    shipped = [WHEELED_ROBOT, KINEMATIC_ROBOT]
    robots = [options.robot] if options.robot else shipped
    checked = check_arena(options.arena, robots, _tell)
    for line in report.lines(checked.arena, checked.findings):
        print(line)
    if options.picture and checked.scene and checked.grid:
        from epuck_mj.check.picture import region_figure
        from epuck_mj.show.pictures import save_figure

        figure = region_figure(checked.scene, checked.grid, checked.arena.stem)
        save_figure(figure, options.picture, dpi=120)
        print(f"picture: {options.picture}")
    elif options.picture:
        print("no picture: there are no walls to draw")
    return 0 if report.usable(checked.findings) else 1


def _tell(doing: str) -> None:
    """Tell somebody who waits what is being done."""
    if sys.stderr.isatty():
        print(doing, file=sys.stderr, flush=True)


if __name__ == "__main__":
    main(check)

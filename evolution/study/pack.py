"""Pack an older study: `python -m evolution.study.pack FOLDER...`."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from epuck_mj.errors import UserError
from epuck_mj.host.command_line import main, parse, word
from evolution.study.directory import StudyDirectory

EXAMPLES = (
    "python -m evolution.study.pack runs/paper",
    "python -m evolution.study.pack runs/paper runs/wheels",
)


@dataclass(frozen=True)
class Options:
    """Move the finished runs of a study from their folders into its tables.

    evolution.study does so by itself. Studies that older versions wrote have a folder
    for each run; runs that are not finished move to running/ and can be continued.

    Attributes:
        studies: study directories.
    """

    studies: tyro.conf.Positional[Annotated[tuple[Path, ...], word("STUDY")]]


def pack_studies(argv: Sequence[str]) -> int:
    """Run the command line and return its exit status, 1 if some run is not packed.

    Raises:
        UserError: if no study is named, or one is none.
    """
    options = parse(Options, "python -m evolution.study.pack", argv, examples=EXAMPLES)
    if not options.studies:
        raise UserError("expected study directories")
    studies = [StudyDirectory(path) for path in options.studies]
    for study in studies:
        # checked before any work
        study.stored_config()
    # pyarrow is slow to import: after the checks of the command line
    from evolution.study.packing import pack

    left = 0
    for study in studies:
        done = pack(study)
        left += len(done.left)
        for line in done.notes:
            print(line, file=sys.stderr)
        for line in done.left:
            print(f"{study.path}: left as it is: {line}", file=sys.stderr)
        print(
            f"{study.path}: {done.packed} runs packed, {done.moved} unfinished runs "
            f"moved, {len(study.tables.packed())} runs in the tables"
        )
    return 1 if left else 0


if __name__ == "__main__":
    main(pack_studies)

"""Files of a run in a study's tables: `python -m evolution.export RUN FILE`."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from epuck_mj.host import files
from epuck_mj.host.command_line import main, parse, word
from evolution.run.directory import RunDirectory
from evolution.study.addresses import champion_at, run_at

CONFIG = (".yaml", ".yml")
"""Endings of files that get the config."""

EXAMPLES = (
    "python -m evolution.export results/paper/de-best/seed-1 champion.json",
    "python -m evolution.export results/paper/de-best/seed-1 again.yaml",
)


@dataclass(frozen=True)
class Options:
    """Write the champion of a run as a controller file, or the run's config as YAML.

    The bridge drives a robot with the controller file; evolution.run does the run again
    from the config.

    Attributes:
        run: STUDY/EXPERIMENT/seed-N, or the directory of a run.
        file: file to write; it gets the config if its name ends with .yaml.
    """

    run: tyro.conf.Positional[Annotated[Path, word("RUN")]]
    file: tyro.conf.Positional[Annotated[Path, word("FILE")]]


def export(argv: Sequence[str]) -> int:
    """Run the command line and return its exit status."""
    options = parse(Options, "python -m evolution.export", argv, examples=EXAMPLES)
    files.check_writable(options.file)
    if options.file.suffix in CONFIG:
        run = run_at(options.run)
        in_folder = isinstance(run, RunDirectory)
        text = (run.stored_config() if in_folder else run.config).to_yaml()
    else:
        text = champion_at(options.run).to_json()
    with files.writing():
        files.write_text(options.file, text)
    print(f"Written: {options.file}")
    return 0


if __name__ == "__main__":
    main(export)

"""A study as pandas data frames."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from epuck_mj.errors import UserError
from epuck_mj.host import files
from epuck_mj.host.yaml_and_json import read_json
from evolution.study.directory import StudyDirectory

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class Study:
    """The tables of a study.

    Attributes:
        champions: a row per finished run: its experiment and seed, the champion's
            genome, what it is worth, and how it was tested.
        history: a row per run and generation; of long runs, of some generations.
        provenance: of the runs; the column `provenance` of `champions` names one of its
            `provenances` by `id`.
    """

    champions: "pd.DataFrame"
    history: "pd.DataFrame"
    provenance: dict[str, Any]


def load(path: str | Path) -> Study:
    """Read the tables of a study.

    Args:
        path: the study's directory.

    Raises:
        UserError: if it has no tables, or they are damaged.
    """
    import pandas as pd

    from evolution.study.histories import SCHEMA
    from evolution.study.table_files import read_table

    tables = StudyDirectory(Path(path)).tables
    if not files.is_file(tables.champions):
        raise UserError(
            f"no '{tables.champions}': expected the directory of a study with finished "
            "runs; python -m evolution.study.pack packs those of an older study"
        )
    frames: list[pd.DataFrame] = [
        read_table(file, names).to_pandas()
        for file, names in (
            (tables.champions, ("experiment", "seed", "genome")),
            (tables.history, SCHEMA.names),
        )
    ]
    champions, history = frames
    return Study(champions, history, read_json(tables.provenance))

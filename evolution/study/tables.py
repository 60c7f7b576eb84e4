"""Tables of a study: champions.parquet, history.parquet, provenance.json, timing.csv.

The first two have the same bytes for the same study, however often it was interrupted.
A run is in the tables if champions.parquet, which is written last, has its row.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

from epuck_mj.errors import UserError
from epuck_mj.host import files
from epuck_mj.host.csv_text import csv_columns, csv_text
from epuck_mj.policies.file import CHAMPIONS
from evolution.run.history import table_text
from evolution.study.columns import Row, rows_of, table_of
from evolution.study.config import StudyConfig
from evolution.study.finished_run import FinishedRun, run_of_row
from evolution.study.histories import (
    SCHEMA,
    History,
    RunKey,
    checked,
    histories_in,
    history_table,
    merged,
)
from evolution.study.provenances import (
    read_provenances,
    together,
    write_provenances,
)
from evolution.study.table_files import read_table, with_values, write_table
from evolution.study.thinning import thinned


class Tables:
    """The tables in a study's directory."""

    def __init__(self, study: Path):
        """Name the files, without touching them."""
        self.study = study
        self.champions = study / CHAMPIONS
        self.history = study / "history.parquet"
        self.provenance = study / "provenance.json"
        self.timing = study / "timing.csv"

    def packed(self) -> set[RunKey]:
        """Experiment and seed of each run in the tables.

        Raises:
            UserError: if they are damaged.
        """
        if not files.is_file(self.champions):
            return set()
        table = read_table(self.champions, KEYS, some=True)
        columns = (table[name].to_pylist() for name in KEYS)
        return set(zip(*columns, strict=True))

    def rows(self, only: RunKey | None = None) -> list[Row]:
        """The rows of champions.parquet, or of one run; none if there is no such file.

        Raises:
            UserError: if it is damaged.
        """
        if not files.is_file(self.champions):
            return []
        try:
            table = read_table(self.champions)
            return rows_of(table if only is None else with_values(table, KEYS, only))
        except (ValueError, TypeError, KeyError) as error:
            raise UserError(f"'{self.champions}' is damaged: {error}") from None

    def histories(self) -> dict[RunKey, History]:
        """The histories of all runs.

        Raises:
            UserError: if they are damaged, or not there.
        """
        table = checked(read_table(self.history, SCHEMA.names), self.history)
        try:
            return histories_in(table)
        except ValueError as error:
            raise UserError(f"'{self.history}' is damaged: {error}") from None

    def runs(
        self,
        config: StudyConfig,
        histories: bool = True,
        only: RunKey | None = None,
    ) -> dict[RunKey, FinishedRun]:
        """The runs of a study's experiments, in the order of the table.

        Args:
            config: of the study.
            histories: whether to read these, too.
            only: the run that is asked for; None for all.

        Raises:
            UserError: if the tables, or the rows that are asked for, are damaged.
        """
        found, damaged = self.sound_runs(config, histories, only)
        for error in damaged.values():
            raise error
        return found

    def sound_runs(
        self,
        config: StudyConfig,
        histories: bool = True,
        only: RunKey | None = None,
    ) -> tuple[dict[RunKey, FinishedRun], dict[RunKey, UserError]]:
        """The runs as `runs` gives them, and what is wrong with the rows of others.

        Raises:
            UserError: if a table as a whole is damaged.
        """
        rows = self.rows(only)
        read = self.histories() if rows and histories else {}
        provenances, seconds = read_provenances(self.provenance), self.seconds()
        found: dict[RunKey, FinishedRun] = {}
        damaged: dict[RunKey, UserError] = {}
        for row in rows:
            if ("experiment",) not in row or ("seed",) not in row:
                raise UserError(f"'{self.champions}' is damaged: a row names no run")
            run = name, seed = _run(row)
            if name not in config.experiments:
                continue
            if run in found or run in damaged:
                raise UserError(
                    f"'{self.champions}' is damaged: it has {name} seed {seed} twice"
                )
            try:
                if histories and run not in read:
                    raise UserError(f"'{self.history}' has no rows of it")
                origin = row.get(("provenance",), "")
                if origin not in provenances:
                    raise UserError(f"'{self.provenance}' has no id '{origin}'")
                found[run] = run_of_row(
                    row,
                    self.study,
                    config.with_seed(name, seed),
                    provenances[origin],
                    read.get(run, {}),
                    seconds.get(run, 0.0),
                )
            except UserError as error:
                damaged[run] = error
        return found, damaged

    def add(
        self, runs: Sequence[FinishedRun], order: Sequence[str], again: bool = False
    ) -> None:
        """Write finished runs into the tables.

        Args:
            runs: to be added, with histories.
            order: names of all experiments, as the study has them.
            again: whether to replace runs that are there already, which stay else.

        Raises:
            OSError: if the tables cannot be written; what was there is intact.
            UserError: if what is there is damaged.
        """
        rows = {_run(row): row for row in self.rows()}
        new = [run for run in runs if again or (run.experiment, run.seed) not in rows]
        rows |= {(run.experiment, run.seed): run.row for run in new}
        # experiments that the study does not name any more stay, at the end
        others = sorted({name for name, _ in rows} - set(order))
        rank = {name: i for i, name in enumerate([*order, *others])}
        kept = sorted(rows, key=lambda run: (rank[run[0]], run[1]))
        entries = [*read_provenances(self.provenance).values()]
        known = together([*entries, *(dict(run.provenance) for run in new)])
        used = [rows[run].get(("provenance",), "") for run in kept]
        histories = {(run.experiment, run.seed): run.history for run in new}
        parts = [history_table(histories)]
        if files.is_file(self.history):
            before = read_table(self.history, SCHEMA.names)
            parts.insert(0, checked(before, self.history))
        seconds = self.seconds() | {
            (run.experiment, run.seed): run.seconds for run in new
        }
        # the last one counts: after a kill in between the runs are added anew
        write_provenances(self.provenance, known, [id for id in used if id in known])
        _write_seconds(self.timing, {r: seconds[r] for r in kept if r in seconds})
        write_table(self.history, thinned(merged(parts, kept, list(rank))))
        write_table(self.champions, table_of([rows[run] for run in kept]))

    def seconds(self) -> dict[RunKey, float]:
        """Seconds of the generations of each run, as timing.csv has them.

        Raises:
            UserError: if it is damaged.
        """
        columns = csv_columns(table_text(self.timing))
        texts = (columns.get(name, []) for name in TIMING)
        try:
            return {
                (name, int(seed)): float(seconds)
                for name, seed, seconds in zip(*texts, strict=True)
            }
        except ValueError as error:
            raise UserError(f"'{self.timing}' is damaged: {error}") from None


KEYS = ("experiment", "seed")
"""Columns of champions.parquet that name a run."""

TIMING = (*KEYS, "seconds")
"""Columns of timing.csv."""


def _write_seconds(path: Path, seconds: Mapping[RunKey, float]) -> None:
    rows = (
        {"experiment": name, "seed": seed, "seconds": f"{time:.3f}"}
        for (name, seed), time in seconds.items()
    )
    files.write_text(path, csv_text(TIMING, rows))


def _run(row: Row) -> RunKey:
    return row["experiment",], row["seed",]

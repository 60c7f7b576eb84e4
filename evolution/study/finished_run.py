"""A finished run of a study, read from its directory or from its row."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from epuck_mj.errors import UserError
from epuck_mj.host import files
from epuck_mj.host.command_line import shell_command
from epuck_mj.policies.file import ControllerFile, Origin
from evolution.judging.scores import Scores, read_champion
from evolution.run.champion import Stored, best_stored
from evolution.run.directory import RunDirectory
from evolution.run.history import CLIMBED, ROBOT, read_best_individuals
from evolution.settings.comparison import differing_keys
from evolution.settings.config import ExperimentConfig
from evolution.study.columns import Row, score_fields, score_values
from evolution.study.histories import History, history_of, seconds_of
from evolution.study.provenances import provenance_of


@dataclass(frozen=True, eq=False)
class FinishedRun:
    """What a study keeps of a finished run.

    Attributes:
        experiment: name of its experiment.
        config: of the run, seed included.
        champion: the champion, with its task, origin and scores.
        scores: what it is worth.
        best_stored: genome of the individual with the highest stored fitness,
            `(genes,)`; None if it is not known.
        history: of its generations; empty if only the champion was asked for.
        provenance: entry of provenance.json.
        path: `STUDY/EXPERIMENT/seed-N`, or the directory that the run is still in.
        seconds: of its generations; 0 if not known.
        note: what of it could not be kept, and why; empty if all could.
    """

    experiment: str
    config: ExperimentConfig
    champion: ControllerFile
    scores: Scores
    best_stored: np.ndarray | None
    history: History
    provenance: Mapping[str, Any]
    path: Path
    seconds: float = 0.0
    note: str = ""

    @property
    def seed(self) -> int:
        """Its seed."""
        return self.config.seed

    @property
    def control_steps(self) -> int | None:
        """Control steps that the run took, None if it did not count them."""
        steps = self.history.get("control_steps", np.zeros(0))
        return int(np.nansum(steps)) or None

    def held_out(self, robot: str) -> float:
        """The champion's mean on the test starts."""
        return self.scores.held_out[robot].mean

    def held_out_as_evolved(self, robot: str) -> float:
        """The champion's mean with disturbances as it evolved; nan if not tested so."""
        test = self.scores.held_out_as_evolved.get(robot)
        return math.nan if test is None else test.mean

    @property
    def row(self) -> Row:
        """Its row of champions.parquet."""
        row: Row = {
            ("experiment",): self.experiment,
            ("seed",): self.seed,
            ("robot",): str(self.history[ROBOT][0]),
            ("evaluations",): int(self.history["evaluations"][-1]),
            ("provenance",): self.provenance["id"],
            ("genome",): self.champion.genome.tolist(),
            **score_values(self.scores),
        }
        if self.control_steps is not None:
            row["control_steps",] = self.control_steps
        if self.best_stored is not None:
            row["best_stored", "genome"] = self.best_stored.tolist()
        return row


def read_finished(
    directory: RunDirectory, experiment: str, config: ExperimentConfig
) -> FinishedRun:
    """A finished run from its directory.

    Args:
        directory: of the run.
        experiment: name of its experiment.
        config: that it has to have, seed included.

    Raises:
        UserError: if it is not finished, damaged, or of another config.
    """
    if not directory.marked_finished():
        raise UserError("not finished")
    lost = "; ".join(directory.lost())
    if lost and files.is_file(directory.checkpoint):
        again = shell_command("evolution.run", "--resume", directory.path)
        raise UserError(f"incomplete: {lost}; to write it again: {again}")
    if lost:
        raise UserError(f"incomplete: {lost}")
    differing = differing_keys(directory.stored_config(), config)
    if differing:
        raise UserError(f"of another config: {', '.join(differing)}")
    champion, scores = read_champion(directory.champion)
    # the tables say neither of these: the study's config does
    if (champion.task, champion.network) != (config.task, config.topology):
        raise UserError(f"'{directory.champion}' is of another task or network")
    history, lost_counts = history_of(directory, Path(config.robot).name)
    genome, lost_genome = _best_stored(directory, history, config.topology.n_genes)
    return FinishedRun(
        experiment=experiment,
        config=config,
        champion=champion,
        scores=scores,
        best_stored=genome,
        history=history,
        provenance=provenance_of(directory.provenance_fields()),
        path=directory.path,
        seconds=seconds_of(directory),
        note="; ".join(filter(None, (lost_counts, lost_genome))),
    )


def _best_stored(
    directory: RunDirectory, history: History, n_genes: int
) -> tuple[np.ndarray | None, str]:
    """The genome with the highest stored fitness; of a run that climbed, since then.

    Returns:
        It, or None and a line that says why it is not known.

    Raises:
        UserError: if the best individuals cannot be read.
    """
    genomes, best = read_best_individuals(directory.best_individuals, n_genes)
    if not np.array_equal(best, history["best"]):
        return None, (
            f"'{directory.best_individuals}' has {best.size} of {history['best'].size} "
            "generations, or other ones: best_stored_genome stays empty"
        )
    first = int(history[CLIMBED].argmax())
    nobody = np.empty((0, n_genes)), np.empty(0)
    return best_stored(Stored(*nobody, genomes[first:], best[first:]))[0], ""


def run_of_row(
    row: Row,
    study: Path,
    config: ExperimentConfig,
    provenance: Mapping[str, Any],
    history: History,
    seconds: float,
) -> FinishedRun:
    """A run from its row.

    Args:
        row: of champions.parquet.
        study: the study's directory.
        config: of the run, seed included.
        provenance: of the run.
        history: of the run; empty if it is not asked for.
        seconds: of its generations; 0 if not known.

    Raises:
        UserError: if the row is damaged.
    """
    experiment = row["experiment",]
    path = study / experiment / f"seed-{config.seed}"
    for place in (("tested_on",), ("genome",), ("stored",)):
        if place not in row:
            raise UserError(f"'{path}' is damaged: it has no {'_'.join(place)}")
    try:
        scores = Scores.read(score_fields(row), path)
    except KeyError as error:
        raise UserError(f"'{path}' is damaged: it has no {error}") from None
    champion = ControllerFile(
        network=config.topology,
        genome=_genes(row["genome",], config, path),
        task=config.task,
        origin=Origin(
            config.robot,
            config.arena,
            config.start_clearance,
            dict(provenance.get("mjcf_sha256") or {}),
            dict(provenance.get("own_sha256") or {}),
        ),
        scores=scores.to_dict(),
    )
    best = row.get(("best_stored", "genome"))
    return FinishedRun(
        experiment=experiment,
        config=config,
        champion=champion,
        scores=scores,
        best_stored=None if best is None else _genes(best, config, path),
        history=history,
        provenance=provenance,
        path=path,
        seconds=seconds,
    )


def _genes(genome: list[float], config: ExperimentConfig, path: Path) -> np.ndarray:
    genes = np.array(genome, float)
    n = config.topology.n_genes
    if genes.shape != (n,) or not np.isfinite(genes).all():
        raise UserError(f"'{path}' is damaged: expected {n} finite genes")
    return genes

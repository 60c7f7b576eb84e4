"""What is written of a run, read before any work is done."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from epuck_mj.host import files
from epuck_mj.host.csv_text import csv_columns
from epuck_mj.host.yaml_and_json import read_json
from epuck_mj.policies.file import ControllerFile
from epuck_mj.trials.trajectory import Trajectory
from evolution.judging.scores import read_champion
from evolution.run.directory import RunDirectory
from evolution.run.history import read_best_individuals, read_history
from evolution.settings.config import ExperimentConfig
from evolution.study.addresses import PlacedRun
from evolution.study.directory import RUNNING, StudyDirectory

if TYPE_CHECKING:
    from evolution.study.finished_run import FinishedRun


@dataclass(frozen=True, eq=False)
class Written:
    """What is written of a run, in its directory or in the tables of a study.

    Attributes:
        run: the directory; of a run in tables, where it would be.
        packed: whether the run is in tables.
        config: of config.yaml.
        source: the config that the run was made with: of its checkpoint, of the study
            it is in, or else `config`.
        has_checkpoint: whether there is a checkpoint.
        provenance: as `read_provenance` gives it.
        champion: fields of champion.json.
        controller: the same, understood.
        history: columns of history.csv by name, `(generations,)` each.
        best: genomes `(generations, genes)` and fitness `(generations,)` of
            best_individuals.npz; of a run in tables, those of one individual, the one
            with the highest stored fitness, or of none if it is not known.
        timing: columns of timing.csv, by name.
        trajectory: of trajectory.npz; None if it is not there.
    """

    run: RunDirectory
    packed: bool
    config: ExperimentConfig
    source: ExperimentConfig
    has_checkpoint: bool
    provenance: Mapping[str, Any]
    champion: Mapping[str, Any]
    controller: ControllerFile
    history: Mapping[str, np.ndarray]
    best: tuple[np.ndarray, np.ndarray]
    timing: Mapping[str, list[str]]
    trajectory: Trajectory | None


def read_run(run: PlacedRun) -> Written:
    """What is written of a finished run.

    Raises:
        UserError: if something is missing or damaged.
    """
    return _of_directory(run) if isinstance(run, RunDirectory) else _of_tables(run)


def _of_tables(run: "FinishedRun") -> Written:
    """What the tables of a study say of a run."""
    genome, highest = run.best_stored, run.scores.best_stored
    best = np.empty((0, run.champion.genome.size)), np.empty(0)
    if genome is not None and highest is not None:
        best = genome[None], np.array([highest.fitness])
    return Written(
        run=RunDirectory(run.path),
        packed=True,
        config=run.config,
        source=run.config,
        has_checkpoint=False,
        provenance=run.provenance,
        champion=json.loads(run.champion.to_json()),
        controller=run.champion,
        history=run.history,
        best=best,
        timing={},
        trajectory=None,
    )


def _of_directory(run: RunDirectory) -> Written:
    """What is written in the directory of a finished run.

    Raises:
        UserError: if something is missing or damaged.
    """
    provenance, config = run.provenance_fields(), run.stored_config()
    source = _source(run, config)
    controller, _ = read_champion(run.champion)
    there = files.is_file(run.trajectory)
    return Written(
        run=run,
        packed=False,
        config=config,
        source=source,
        has_checkpoint=files.is_file(run.checkpoint),
        provenance=provenance,
        champion=read_json(run.champion),
        controller=controller,
        history=read_history(run.history),
        best=read_best_individuals(run.best_individuals, source.topology.n_genes),
        timing=csv_columns(files.read_text(run.timing)),
        trajectory=Trajectory.load(run.trajectory) if there else None,
    )


def _source(run: RunDirectory, config: ExperimentConfig) -> ExperimentConfig:
    """The config that a run was made with, as far as anything but itself says.

    Raises:
        UserError: if the checkpoint or the study is damaged.
    """
    if files.is_file(run.checkpoint):
        return run.checkpoint_config(files.read_arrays(run.checkpoint))
    place = run.path.resolve()
    name, folder = place.parent.name, place.parent.parent
    study = StudyDirectory(folder.parent if folder.name == RUNNING else folder)
    if not files.is_file(study.config):
        return config
    experiments = study.stored_config()
    for seed, there in study.runs(name):
        if name in experiments.experiments and there.path == place:
            return experiments.with_seed(name, seed)
    return config

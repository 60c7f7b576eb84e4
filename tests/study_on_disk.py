"""A finished study on disk, without the days of evolution that it would take."""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from epuck_mj.host import files
from epuck_mj.policies.file import ControllerFile, Origin
from epuck_mj.policies.network import Network
from epuck_mj.step.control import TaskParameters
from evolution.settings.config_files import find_config, load_config
from evolution.study.config import StudyConfig
from evolution.study.directory import StudyDirectory
from evolution.study.packing import pack

ROBOTS = ("epuck", "epuck_kinematic")
LEVELS = {"de-best": 220.0, "de-rand": 180.0, "ga": 120.0}
POPULATIONS = {"de-best": 150, "de-rand": 120, "ga": 100}
EVALUATIONS = 3000
STEPS = 300
ORIGIN = Origin("epuck_kinematic", "arena")


def held_out(mean: float, rng: np.random.Generator) -> dict:
    """What `evolution.judging.held_out.HeldOut` says of a champion, made up."""
    follows = float(np.clip(mean / 230, 0, 1))
    return {
        "mean": mean,
        "standard_deviation": 40.0,
        "interval": [mean - 2.5, mean + 2.5],
        "worst": mean / 4,
        "crash_rate": 1 - follows,
        "collisions_per_minute": 3 * (1 - follows),
        "starts": 1000,
        "behaviour": {
            "crashed": 1 - follows,
            "hugger": follows / 4,
            "wall follower": follows * 3 / 4,
            "spinner": 0.0,
        },
        "metrics": {"clearance_mean": float(rng.uniform(0.002, 0.012))},
    }


def history(name: str, seed: int) -> np.ndarray:
    """Rows of a history.csv, `(generations, 5)`; the best rises and falls."""
    rng = np.random.default_rng([seed, POPULATIONS[name]])
    n = EVALUATIONS // POPULATIONS[name]
    best = LEVELS[name] * (1 - np.exp(-np.linspace(0.1, 4, n)))
    best = np.maximum(best + rng.normal(0, 4, n), 1)
    evaluations = np.arange(1, n + 1) * POPULATIONS[name]
    return np.column_stack(
        [np.arange(n), evaluations, best, best * 0.6, np.full(n, 3.0)]
    )


def write_study(
    path: Path,
    seeds: Mapping[str, list[int]],
    yardstick: bool = True,
    packed: bool = True,
) -> Path:
    """A study of experiments, each with finished runs of those seeds.

    They are in the tables, or in their directories as if the study had been killed.
    """
    configs = {
        name: load_config(find_config(name)).model_copy(
            update={"evaluations": EVALUATIONS}
        )
        for name in seeds
    }
    config, directory = StudyConfig(configs), StudyDirectory(path)
    path.mkdir(parents=True)
    directory.config.write_text(config.to_yaml())
    if yardstick:
        tests = {
            robot: held_out(195.0, np.random.default_rng(0)) | {"crash_rate": 0.01}
            for robot in ROBOTS
        }
        directory.yardstick.write_text(json.dumps({"held_out": tests}))
    for name, each in seeds.items():
        for seed in each:
            _write_run(directory, config, name, seed)
    if packed:
        packing = pack(directory)
        assert packing.packed == sum(map(len, seeds.values()))
        assert not (packing.left or packing.notes)
    return path


def _write_run(
    directory: StudyDirectory, config: StudyConfig, name: str, seed: int
) -> None:
    rng = np.random.default_rng([seed, len(name)])
    run = directory.run(name, seed)
    run.path.mkdir(parents=True)
    run.config.write_text(config.with_seed(name, seed).to_yaml())
    rows = history(name, seed)
    text = "".join(
        f"{int(g)},{int(e)},{best!r},{mean!r},{std!r}\n"
        for g, e, best, mean, std in rows.tolist()
    )
    run.history.write_text("generation,evaluations,best,mean,std\n" + text)
    genomes = np.zeros((len(rows), Network().n_genes))
    best = {"genomes": genomes, "fitness": rows[:, 2]}
    files.write_arrays(run.best_individuals, best)
    run.timing.write_text(
        "generation,seconds,control_steps,crash_rate\n"
        "0,1.5,1000,0.1\n1,1.5,900,0.1\n1,1.4,900,0.1\n"
    )
    wheels = float(LEVELS[name] - rng.uniform(5, 50))
    scores = {
        "stored": float(rows[:, 2].max()),
        "validation": wheels + 1,
        "best_stored": {"fitness": float(rows[:, 2].max()), "held_out": wheels - 9},
        "held_out": {
            "epuck": held_out(wheels, rng),
            "epuck_kinematic": held_out(wheels + float(rng.uniform(0, 10)), rng),
        },
    }
    genome = rng.uniform(-5, 5, Network().n_genes)
    champion = ControllerFile(
        Network(), genome, TaskParameters(steps=STEPS), ORIGIN, scores
    )
    run.champion.write_text(champion.to_json())
    provenance = {
        "argv": ["paper", "--seeds", "1-30", "--output", "runs/paper"],
        "versions": {"python": "3.11", "mujoco": "3.17.0"},
        "git": {"commit": "abc123", "modified": seed == 1},
        "processor": {"model": "A <fast> processor"},
        "finished": "2026-01-01T00:00:00+00:00",
    }
    run.provenance.write_text(json.dumps(provenance))

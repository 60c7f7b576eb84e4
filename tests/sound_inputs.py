"""A sound input of each kind that commands read, made in a second."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import yaml

from epuck_mj.policies.file import ControllerFile, Origin
from epuck_mj.policies.network import Network
from epuck_mj.step.calibration import Calibration
from epuck_mj.step.control import TaskParameters
from evolution.run.execution import Run
from evolution.run.means import Means
from evolution.settings.config import ExperimentConfig
from evolution.study.config import StudyConfig
from evolution.study.directory import StudyDirectory
from evolution.study.packing import pack

BEGUN = "begun/running/mine/seed-1"
"""A run that has evolved and is to be resumed; its champion is made up."""

FINISHED = "finished/running/mine/seed-1"
"""The same run, marked as finished."""

PACKED = "packed/mine/seed-1"
"""Address of the same run in the tables of a study."""

KEYS = {
    "seed": 1,
    "evaluations": 8,
    "robot": "epuck_kinematic",
    "arena": "arena",
    "trials": 1,
    "steps": 3,
    "control_step": 0.1,
    "fitness": "product",
    "v_max": 0.1,
    "noise": "none",
    "randomise": False,
    "hidden": 4,
    "biases": False,
    "weight_bound": 5.0,
    "validation_starts": 2,
    "test_starts": 2,
    "optimizer": {"algorithm": "genetic_algorithm", "population": 4, "bits": 8},
}
TEST = {"mean": 1.5, "crash_rate": 0.5, "starts": 2}
SCORES = {"stored": 2.5, "validation": 1.5, "held_out": {"epuck_kinematic": TEST}}

ARENA = """<mujoco model="mine">
  <option timestep="0.01" integrator="implicitfast"/>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 1" contype="2" conaffinity="2"/>
    <geom name="east" type="box" pos="0.5 0 0.03" size="0.01 0.5 0.03"/>
    <geom name="west" type="box" pos="-0.5 0 0.03" size="0.01 0.5 0.03"/>
    <geom name="north" type="box" pos="0 0.5 0.03" size="0.5 0.01 0.03"/>
    <geom name="south" type="box" pos="0 -0.5 0.03" size="0.5 0.01 0.03"/>
  </worldbody>
</mujoco>
"""


def write_sound_inputs() -> None:
    """Write them into the working directory."""
    Path("mine.yaml").write_text(yaml.safe_dump(KEYS))
    study = {"experiments": ["mine.yaml"], "common": {"steps": 3, "hidden": 4}}
    Path("study.yaml").write_text(yaml.safe_dump(study))
    Calibration(track=0.054).save(Path("robot.yaml"))
    Path("arena.xml").write_text(ARENA)
    config = ExperimentConfig.parsed(KEYS, "mine")
    begun = StudyDirectory(Path("begun"))
    begun.open(StudyConfig({"mine": config}), [1])
    run = begun.run("mine", 1)
    with run.locked():
        evolution = Run(config, run, Means(), ["mine.yaml"])
        evolution.start()
        assert list(evolution.evolve())
    genome = np.random.default_rng(0).uniform(-5, 5, Network().n_genes)
    origin, task = Origin("epuck_kinematic", "arena", 0.01), TaskParameters(steps=3)
    champion = ControllerFile(Network(), genome, task, origin, SCORES)
    for path in (run.champion, Path("champion.json")):
        path.write_text(champion.to_json())
    shutil.copytree("begun", "finished")
    provenance = Path(FINISHED, "provenance.json")
    done = json.loads(provenance.read_text()) | {"finished": "2026-01-01T00:00:00"}
    provenance.write_text(json.dumps(done))
    shutil.copytree("finished", "packed")
    packed = StudyDirectory(Path("packed"))
    scores = SCORES | {"held_out": {"epuck": TEST, "epuck_kinematic": TEST}}
    tested = replace(champion, task=config.task, scores=scores)
    packed.run("mine", 1).champion.write_text(tested.to_json())
    assert pack(packed).packed == 1

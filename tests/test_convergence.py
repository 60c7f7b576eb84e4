"""The shipped physics step is fine enough, and rolling stands for wheels on a floor."""

import functools
from dataclasses import replace

import pytest

from benchmarks import convergence
from benchmarks.convergence import (
    REFINEMENT,
    TASK,
    TOLERANCE,
    Configuration,
    configurations,
    controllers,
    deviation,
    held_out_starts,
    mean_fitness,
)
from epuck_mj.scene.model import load_scene
from epuck_mj.scene.model_files import KINEMATIC_ROBOT, WHEELED_ROBOT
from epuck_mj.step.control import BatchPolicy

N_STARTS = 10
"""Far fewer than the benchmark's: a single changed outcome is more than tolerated."""

STEPS = 200
"""Two thirds of the benchmark's: a step that is a little too coarse shows late."""

CHOSEN = ("by hand", "de-best-seed-1", "fragile")
"""The slowest to notice a coarse step, one that evolved, and the quickest."""

KEPT = 0.95
"""Share of its kinematic fitness that a controller keeps on wheels."""


@pytest.fixture(autouse=True, scope="module")
def short_trials():
    """Trials of `STEPS`."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(convergence, "TASK", replace(TASK, steps=STEPS))
        yield


@functools.cache
def chosen() -> dict[str, BatchPolicy]:
    every = controllers(N_STARTS)
    return {name: every[name] for name in CHOSEN}


@pytest.fixture(scope="module")
def fitness() -> dict[str, dict[str, float]]:
    """Mean fitness of each controller on each robot at its shipped step."""
    return {
        robot: mean_fitness(
            load_scene(robot, "arena"),
            chosen(),
            held_out_starts(load_scene(robot, "arena"), N_STARTS),
        )
        for robot in (WHEELED_ROBOT, KINEMATIC_ROBOT)
    }


@pytest.mark.slow
def test_a_fifth_of_the_step_gives_the_same_fitness(wheels, fitness):
    finer = Configuration(wheels.model.opt.timestep / REFINEMENT).scene()
    assert finer.n_substeps == REFINEMENT * wheels.n_substeps
    starts = held_out_starts(wheels, N_STARTS)
    reference = mean_fitness(finer, chosen(), starts)
    assert deviation(fitness["epuck"], reference) <= TOLERANCE


@pytest.mark.slow
def test_wheels_keep_what_rolling_gives(fitness):
    for name, rolling in fitness["epuck_kinematic"].items():
        assert fitness["epuck"][name] >= KEPT * rolling, name


@pytest.mark.slow
def test_a_coarse_step_is_told_apart(fitness):
    """The check can fail: at 20 ms the wheeled robot ruins a good controller."""
    coarse = Configuration(1 / 50).scene()
    starts = held_out_starts(coarse, N_STARTS)
    spoilt = mean_fitness(coarse, chosen(), starts)
    assert deviation(spoilt, fitness["epuck"]) > 2 * TOLERANCE


def test_every_configuration_can_be_made():
    for configuration in configurations(0.01):
        scene = configuration.scene()
        assert scene.model.opt.timestep == configuration.timestep
        assert scene.n_substeps == round(TASK.control_step / configuration.timestep)

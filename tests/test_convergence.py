"""The shipped physics steps are fine enough, and the plane stands for the floor."""

import pytest

from benchmarks.convergence import (
    REFINEMENT,
    TOLERANCE,
    Configuration,
    controllers,
    deviation,
    held_out_starts,
    mean_fitness,
)
from epuck_mj.scene.model import load_scene
from epuck_mj.step.control import BatchPolicy

N_STARTS = 40
"""A fifth of the benchmark's; it takes one changed outcome to move a mean by 2.5 %."""

CHOSEN = ("by hand", "de-best-seed-1", "fragile")
"""The slowest to notice a coarse step, one that evolved, and the quickest."""

KEPT = 0.95
"""Share of its planar fitness that a controller keeps on wheels."""


def chosen() -> dict[str, BatchPolicy]:
    return {name: controllers(N_STARTS)[name] for name in CHOSEN}


@pytest.fixture(scope="module")
def fitness() -> dict[str, dict[str, float]]:
    """Mean fitness of each controller on each robot at its shipped step."""
    return {
        robot: mean_fitness(
            load_scene(robot, "arena"),
            chosen(),
            held_out_starts(load_scene(robot, "arena"), N_STARTS),
        )
        for robot in ("epuck", "epuck_planar")
    }


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["epuck", "epuck_planar"])
def test_a_fifth_of_the_step_gives_the_same_fitness(robot, fitness):
    scene = load_scene(robot, "arena")
    finer = Configuration(scene.model.opt.timestep / REFINEMENT).applied(scene)
    assert finer.n_substeps == REFINEMENT * scene.n_substeps
    starts = held_out_starts(scene, N_STARTS)
    reference = mean_fitness(finer, chosen(), starts)
    assert deviation(fitness[robot], reference) <= TOLERANCE


@pytest.mark.slow
def test_wheels_keep_what_the_plane_gives(fitness):
    for name, planar in fitness["epuck_planar"].items():
        assert fitness["epuck"][name] >= KEPT * planar, name


@pytest.mark.slow
def test_a_coarse_step_is_told_apart(fitness):
    """The check can fail: at 33 ms the wheeled robot ruins good controllers."""
    scene = load_scene("epuck", "arena")
    coarse = Configuration(1 / 30).applied(scene)
    starts = held_out_starts(scene, N_STARTS)
    spoilt = mean_fitness(coarse, chosen(), starts)
    assert deviation(spoilt, fitness["epuck"]) > 2 * TOLERANCE

"""Which physics step is fine enough: `python -m benchmarks.convergence`.

A fixed set of controllers lives 200 trials under each configuration: the hand-written
wall follower, evolved champions, and a fragile one, evolved with a softer drive, that
rides 0.4 mm off the wall. A configuration passes if every controller's mean fitness is
within 2.5 % of the shipped configuration's at a fifth of the shipped step: half of the
5 % that tests hold it to. Writes benchmarks/convergence.md.
"""

import copy
import statistics
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import mujoco
import numpy as np

from epuck_mj.host import files
from epuck_mj.host.command_line import main, parse
from epuck_mj.policies.file import load_controller
from epuck_mj.policies.wall_follower import WallFollower
from epuck_mj.rungs.table import robots_in
from epuck_mj.scene.model import Scene, load_scene
from epuck_mj.scene.model_files import WHEELED_ROBOT
from epuck_mj.scene.robot_parts import PREFIX
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.step.control import (
    START_CLEARANCE,
    BatchPolicy,
    TaskParameters,
    run_trials,
)
from evolution.study.addresses import champion_at

HERE = Path(__file__).resolve().parent
CHAMPIONS = HERE.parent / "results" / "paper" / "de-best"
SEEDS = (1, 2, 3)
FRAGILE = HERE / "controllers" / "fragile.json"
REPORT = HERE / "convergence.md"
TASK = TaskParameters()
TOLERANCE = 0.05
MARGIN = TOLERANCE / 2
N_STARTS = 200
REFINEMENT = 5
"""The reference's physics step is this many times smaller than the shipped one."""

STEPS = (1 / 30, 0.025, 0.02, 1 / 60, 0.0125, 0.01, 0.005)
"""Physics steps tried with the shipped contacts and solver [s]."""

_CONE, _SOLVER = mujoco.mjtCone, mujoco.mjtSolver


@dataclass(frozen=True)
class Configuration:
    """How the physics is integrated.

    Attributes:
        timestep: physics step [s].
        cone: friction cone.
        solver: constraint solver.
        support_gap: gap below the supports at rest [m]; None is as shipped.
    """

    timestep: float
    cone: mujoco.mjtCone = _CONE.mjCONE_PYRAMIDAL
    solver: mujoco.mjtSolver = _SOLVER.mjSOL_NEWTON
    support_gap: float | None = None

    def scene(self) -> Scene:
        """The robot on wheels in the square with this configuration."""
        scene = load_scene(WHEELED_ROBOT, "arena", TASK.control_step, self.timestep)
        model = copy.copy(scene.model)
        model.opt.cone, model.opt.solver = self.cone, self.solver
        if self.support_gap is not None:
            for name in ("support_front", "support_rear"):
                geom = model.geom(PREFIX + name)
                geom.pos[2] = geom.size[0] + self.support_gap
        return replace(scene, model=model)

    def row(self) -> str:
        """Its cells of the table."""
        cone = _CONE(self.cone).name.removeprefix("mjCONE_").lower()
        solver = _SOLVER(self.solver).name.removeprefix("mjSOL_")
        gap = (
            "as shipped" if self.support_gap is None else f"{1e3 * self.support_gap} mm"
        )
        return f"{1e3 * self.timestep:.1f} ms | {cone} | {solver} | {gap}"


def configurations(shipped: float) -> list[Configuration]:
    """What is compared: all steps, and every other choice at the finer of them."""
    tried = [Configuration(step) for step in STEPS]
    for step in (shipped, 0.0125):
        tried += [
            Configuration(step, cone=_CONE.mjCONE_ELLIPTIC),
            Configuration(step, solver=_SOLVER.mjSOL_CG),
            Configuration(step, solver=_SOLVER.mjSOL_PGS),
            Configuration(step, support_gap=0.0),
        ]
    return tried


def controllers(n: int) -> dict[str, BatchPolicy]:
    """The fixed set, each as a policy for `n` robots."""
    places = [CHAMPIONS / f"seed-{seed}" for seed in SEEDS]
    evolved = {f"de-best-{place.name}": champion_at(place) for place in places}
    evolved["fragile"] = load_controller(FRAGILE)
    policies: dict[str, BatchPolicy] = {"by hand": WallFollower()}
    for name, file in evolved.items():
        policies[name] = file.network.decode(np.tile(file.genome, (n, 1)))
    return policies


def held_out_starts(scene: Scene, n: int) -> np.ndarray:
    """Starts `(n, 3)` that no run has seen."""
    return FreeSpace(scene, START_CLEARANCE).sample(np.random.default_rng(2026), n)


def mean_fitness(
    scene: Scene, policies: Mapping[str, BatchPolicy], starts: np.ndarray
) -> dict[str, float]:
    """Each controller's mean over the starts."""
    robots = robots_in(scene, len(starts))
    return {
        name: float(run_trials(robots, policy, starts, TASK).fitness.mean())
        for name, policy in policies.items()
    }


def deviation(fitness: Mapping[str, float], reference: Mapping[str, float]) -> float:
    """Largest relative difference of any controller."""
    return max(abs(fitness[name] / reference[name] - 1) for name in reference)


@dataclass(frozen=True)
class Options:
    """Measure how far physics steps can be trusted.

    Attributes:
        starts: trials of each controller.
        output: table to write.
    """

    starts: int = N_STARTS
    output: Path = REPORT


def measure_convergence(argv: Sequence[str]) -> int:
    """Run the command line; its exit status."""
    options = parse(Options, "python -m benchmarks.convergence", argv, Options())
    header = HEADER.format(starts=options.starts, margin=MARGIN)
    text = [header, "", *_table(options.starts)]
    report = "\n".join(text) + "\n"
    with files.writing():
        files.write_text(options.output, report)
    print(report)
    return 0


def _table(n_starts: int) -> list[str]:
    scene = load_scene(WHEELED_ROBOT, "arena", TASK.control_step)
    shipped = scene.model.opt.timestep
    policies, starts = controllers(n_starts), held_out_starts(scene, n_starts)
    finer = Configuration(shipped / REFINEMENT)
    reference, _ = _measured(finer.scene(), policies, starts)
    names = " | ".join(reference)
    lines = [
        f"| step | cone | solver | supports | {names} | deviation | cost | passes |",
        "|" + "---|" * (7 + len(reference)),
        f"| {finer.row()} | {_cells(reference)} | reference | | |",
    ]
    costs, rows = {}, []
    for configuration in configurations(shipped):
        fitness, seconds = _measured(configuration.scene(), policies, starts)
        costs[configuration] = seconds
        off = deviation(fitness, reference)
        rows.append((configuration, fitness, off))
    unit = costs[Configuration(shipped)]
    for configuration, fitness, off in rows:
        mark = "yes" if off <= MARGIN else "no"
        mark += ", shipped" if configuration == Configuration(shipped) else ""
        lines.append(
            f"| {configuration.row()} | {_cells(fitness)} | {off:.1%} | "
            f"{costs[configuration] / unit:.2f} | {mark} |"
        )
    return lines


def _measured(
    scene: Scene, policies: Mapping[str, BatchPolicy], starts: np.ndarray
) -> tuple[dict[str, float], float]:
    """Mean fitness, and CPU seconds for a control step of a robot that lives."""
    fitness = mean_fitness(scene, policies, starts)
    robots, task = robots_in(scene, len(starts), 1), replace(TASK, steps=30)
    costs = []
    for _ in range(3):
        before = time.process_time()
        trials = run_trials(robots, WallFollower(), starts, task)
        costs.append((time.process_time() - before) / trials.steps.sum())
    return fitness, statistics.median(costs)


def _cells(fitness: Mapping[str, float]) -> str:
    return " | ".join(f"{value:.1f}" for value in fitness.values())


HEADER = """# Which physics step is fine enough

Made by `python -m benchmarks.convergence`. Mean fitness of 300 on wheels over {starts}
starts of the hand-written wall follower, of champions of results/paper, and of a
fragile controller, evolved with a softer drive, that rides 0.4 mm off the wall. The
reference is the shipped configuration at a fifth of its step. Deviation: the largest of
any controller; up to {margin:.1%} passes, half of what the tests allow. Cost: CPU time
of a control step, the shipped one's is 1; differences of a few per cent are noise."""

if __name__ == "__main__":
    main(measure_convergence)

"""Throughput of the kinematic robot against wheels: part of `make bench`.

Whole trials with policy and fitness. The jobs are measured in turns: ratios are of
speeds in one turn, and medians over the turns are reported. Speeds are simulated
seconds per CPU-second on one thread, so they fall where other programs use the same
core; what two threads gain is time by the clock and wants an idle machine.
"""

import statistics
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.convergence import CHAMPIONS
from epuck_mj.policies.network import Controller, Network
from epuck_mj.scene.model import Scene, load_scene
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.step.conditions import Conditions
from epuck_mj.step.control import TaskParameters
from evolution.judging.evaluation import BatchEngine, Work
from evolution.judging.held_out_starts import held_out_disturbances
from evolution.settings.randomness import Purpose
from evolution.study.addresses import champion_at

CHAMPION = CHAMPIONS / "seed-1"
"""It drives along walls nearly all the time."""

N_TRIALS = 1500
N_ON_WHEELS = 150
ROOMS = (1, 4, 25, 250)
"""Numbers of square rooms of 1 m, four walls each; robots are spread over them."""

TASK = TaskParameters()

ROOM = """<geom type="box" size="0.55 0.05 0.05" pos="{x} {low_y} 0.05"/>
<geom type="box" size="0.55 0.05 0.05" pos="{x} {high_y} 0.05"/>
<geom type="box" size="0.05 0.45 0.05" pos="{low_x} {y} 0.05"/>
<geom type="box" size="0.05 0.45 0.05" pos="{high_x} {y} 0.05"/>"""


@dataclass(frozen=True)
class Speed:
    """Simulated seconds per second of the CPU, and of the clock."""

    cpu: float
    clock: float


def measure_kinematic(repeats: int) -> dict[str, float]:
    """Speeds, and ratios of speeds in one turn: medians over `repeats` turns."""
    square, cones, wheels = (
        load_scene(robot, "arena")
        for robot in ("epuck_kinematic", "epuck_cone_kinematic", "epuck")
    )
    along = _works(square, N_TRIALS)
    jobs: dict[str, Callable[[], Speed]] = {
        "along_walls": _job(square, along(None), 1),
        "in_the_open": _job(square, _circles(square), 1),
        "two_threads": _job(square, along(None), 2),
        "noise": _job(square, along(Conditions("calibrated")), 1),
        "other_robots": _job(square, along(Conditions("calibrated", True)), 1),
        "cones": _job(cones, along(None), 1),
        "wheels": _job(wheels, _works(wheels, N_ON_WHEELS)(None), 1),
    }
    with tempfile.TemporaryDirectory() as folder:
        for n in ROOMS:
            scene = load_scene("epuck_kinematic", str(rooms(Path(folder), n)))
            jobs[f"walls_{4 * n}"] = _job(scene, _in_rooms(along(None), n), 1)
        turns = [{name: job() for name, job in jobs.items()} for _ in range(repeats)]

    def median(figure: Callable[[dict[str, Speed]], float]) -> float:
        return statistics.median(figure(turn) for turn in turns)

    fewest = f"walls_{4 * ROOMS[0]}"
    return {
        "seconds_per_cpu_second_along_walls": median(lambda t: t["along_walls"].cpu),
        "seconds_per_cpu_second_in_the_open": median(lambda t: t["in_the_open"].cpu),
        "seconds_per_cpu_second_on_wheels": median(lambda t: t["wheels"].cpu),
        "over_wheels": median(lambda t: t["along_walls"].cpu / t["wheels"].cpu),
        "thread_scaling": median(
            lambda t: t["two_threads"].clock / t["along_walls"].clock
        ),
        "cost_of_noise": median(lambda t: t["along_walls"].cpu / t["noise"].cpu),
        "cost_of_cones": median(lambda t: t["along_walls"].cpu / t["cones"].cpu),
        "cost_of_noise_and_other_robots": median(
            lambda t: t["along_walls"].cpu / t["other_robots"].cpu
        ),
        **{
            f"cost_of_{4 * n}_walls": median(
                lambda t, n=n: t[fewest].cpu / t[f"walls_{4 * n}"].cpu
            )
            for n in ROOMS[1:]
        },
    }


def rooms(folder: Path, n: int) -> Path:
    """An arena of `n` square rooms in rows, as a file in a folder."""
    row = int(np.ceil(np.sqrt(n)))
    walls = []
    for i in range(n):
        x, y = 1.2 * (i % row), 1.2 * (i // row)
        sides = {
            "low_x": x - 0.5,
            "high_x": x + 0.5,
            "low_y": y - 0.5,
            "high_y": y + 0.5,
        }
        walls.append(ROOM.format(x=x, y=y, **sides))
    path = folder / f"rooms_{n}.xml"
    floor = '<geom type="plane" size="0 0 0.1"/>'
    path.write_text(
        f"<mujoco><worldbody>{floor}{' '.join(walls)}</worldbody></mujoco>\n"
    )
    return path


def _works(scene: Scene, n: int) -> Callable[[Conditions | None], Work]:
    """Maker of trials of a champion from `n` starts, under conditions."""
    file = champion_at(CHAMPION)
    starts = FreeSpace(scene, 0.1).sample(np.random.default_rng(0), n)
    controller = file.network.decode(np.tile(file.genome, (n, 1)))

    def work(conditions: Conditions | None) -> Work:
        met = (
            held_out_disturbances(conditions, Purpose.TEST, n, TASK.steps)
            if conditions
            else None
        )
        return Work(controller, starts, disturbances=met)

    return work


def circling(n: int) -> Controller:
    """Controllers that drive circles of 3 to 5 cm at a third of full speed."""
    genomes = np.zeros((n, Network().n_genes))
    genomes[:, 32:36] = -0.35
    genomes[:, 36:] = np.random.default_rng(1).uniform(0.2, 0.3, (n, 1))
    return Network().decode(genomes)


def _circles(scene: Scene) -> Work:
    """Small circles in the middle, out of reach of walls."""
    starts = FreeSpace(scene, 0.2).sample(np.random.default_rng(2), N_TRIALS)
    return Work(circling(N_TRIALS), starts)


def _in_rooms(work: Work, n: int) -> Work:
    """The same trials, in a room each in turn."""
    row = int(np.ceil(np.sqrt(n)))
    room = np.arange(len(work)) % n
    starts = work.starts.copy()
    # the square is larger than a room
    starts[:, :2] = 0.8 * starts[:, :2]
    starts[:, 0] += 1.2 * (room % row)
    starts[:, 1] += 1.2 * (room // row)
    return Work(work.controller, starts)


def _job(scene: Scene, work: Work, threads: int) -> Callable[[], Speed]:
    engine = BatchEngine(scene, TASK, threads)
    # compile
    engine.run(work[: min(len(work), 8)])

    def run() -> Speed:
        clock, cpu = time.perf_counter(), time.process_time()
        steps = engine.run(work).steps.sum()
        seconds = float(steps) * TASK.control_step
        return Speed(
            seconds / (time.process_time() - cpu),
            seconds / (time.perf_counter() - clock),
        )

    return run

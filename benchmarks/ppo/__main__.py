"""Train PPO on the vector environment: `python -m benchmarks.ppo`.

It needs the extra `ppo`. The policy with the highest fitness on evolution's validation
starts is kept, as evolution chooses its champions, and written as a controller file.
Settings are the library's defaults, but for the size of a rollout and of a batch, which
suit many robots, and the noise of the first actions.
"""

# the extra is for those who train
# pyright: reportMissingImports=false

import json
import sys
import time
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import torch
import tyro
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from benchmarks.ppo import CURVE
from benchmarks.ppo.network import HIDDEN, Tanh, genome_of
from benchmarks.ppo.robots import Robots
from epuck_mj.environments.gymnasium import ID
from epuck_mj.host.files import write_text
from epuck_mj.host.own_parts import own_part
from epuck_mj.policies.file import CHAMPION, ControllerFile, Origin
from epuck_mj.policies.topology import OwnNetwork
from epuck_mj.scene.model import load_scene
from epuck_mj.scene.model_files import KINEMATIC_ROBOT
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.step.control import START_CLEARANCE, TaskParameters
from evolution.judging.evaluation import BatchEngine, evaluate
from evolution.judging.held_out_starts import starts_for_validation
from evolution.run.provenance import now, provenance, to_json

NETWORK = f"{Tanh.__module__}:{Tanh.__name__}"
ARENA = "arena"

LIBRARIES = ("gymnasium", "stable-baselines3", "torch")

ROBOTS = 1024
ROLLOUT, BATCH = 64, 8192
"""Control steps of each robot between two updates, and of all robots in a batch."""

LOG_STD = -1.0
"""Logarithm of the standard deviation of the first actions."""

EVERY = 500_000
"""Least number of control steps between two looks at the validation starts."""


@dataclass(frozen=True)
class Options:
    """Train PPO for a number of control steps.

    Attributes:
        steps: control steps of all robots together: the most that 30,000 evaluations
            of 5 trials of 300 steps can have.
        minutes: when to stop in any case, by the clock.
        seed: of all randomness.
        threads: threads of torch.
        output: folder for the curve, the champion and what made them.
    """

    steps: int = 45_000_000
    minutes: float = 15.0
    seed: int = 1
    threads: int = 1
    output: Path = Path("results/ppo")


@dataclass(frozen=True)
class Look:
    """Fitness on the validation starts after a number of control steps."""

    steps: int
    seconds: float
    fitness: float
    crash_rate: float


class Judge(BaseCallback):
    """Looks at the policy now and then, keeps the best, and ends training in time."""

    def __init__(self, minutes: float):
        """Load the validation starts of the kinematic robot."""
        super().__init__()
        task = TaskParameters()
        self.scene = load_scene(KINEMATIC_ROBOT, ARENA, task.control_step)
        self._engine = BatchEngine(self.scene, task, 1)
        self._starts = starts_for_validation(FreeSpace(self.scene, START_CLEARANCE))
        self._network = OwnNetwork(NETWORK)
        self._begun, self._end = time.monotonic(), time.monotonic() + 60 * minutes
        self.looks: list[Look] = []
        self.champion, self.genome = -np.inf, np.zeros(Tanh.n_genes)

    def _on_step(self) -> bool:
        return time.monotonic() < self._end

    def _on_rollout_start(self) -> None:
        last = self.looks[-1].steps if self.looks else -EVERY
        if self.num_timesteps >= last + EVERY:
            self.look()

    def look(self) -> None:
        """Test the policy as it is."""
        genome = genome_of(_layers(self.model.policy))
        found = evaluate(self._engine, self._network, genome[None], self._starts)
        fitness = float(found.fitness[0])
        if fitness > self.champion:
            self.champion, self.genome = fitness, genome
        seconds = time.monotonic() - self._begun
        look = Look(self.num_timesteps, seconds, fitness, float(found.crashed.mean()))
        self.looks.append(look)
        print(f"{look.steps:12,} steps {seconds:6.0f} s  fitness {fitness:6.1f}")


def _layers(policy: torch.nn.Module) -> list[tuple[np.ndarray, np.ndarray]]:
    """Weights and biases of the layers that give the mean action."""
    state = policy.state_dict()
    names = [f"mlp_extractor.policy_net.{2 * i}" for i in range(len(HIDDEN))]
    return [
        (state[f"{name}.weight"].numpy(), state[f"{name}.bias"].numpy())
        for name in (*names, "action_net")
    ]


def main(options: Options) -> None:
    """Train, and write what came of it."""
    torch.set_num_threads(options.threads)
    robots = Robots(gymnasium.make_vec(ID, num_envs=ROBOTS))
    model = PPO(
        "MlpPolicy",
        robots,
        n_steps=ROLLOUT,
        batch_size=BATCH,
        policy_kwargs={"net_arch": list(HIDDEN), "log_std_init": LOG_STD},
        seed=options.seed,
        device="cpu",
    )
    judge = Judge(options.minutes)
    of_parts = {NETWORK: own_part(NETWORK).sha256}
    made_by = provenance(judge.scene, of_parts, sys.argv[1:], "ppo", options.threads)
    made_by["versions"] |= {name: version(name) for name in LIBRARIES}
    model.learn(options.steps, callback=judge)
    judge.look()
    _write(options, judge, made_by | {"finished": now()})


def _write(options: Options, judge: Judge, made_by: dict[str, Any]) -> None:
    """Write the curve, the best policy as a controller file, and what made them."""
    options.output.mkdir(parents=True, exist_ok=True)
    curve = {
        "seed": options.seed,
        "robots": ROBOTS,
        "looks": [asdict(look) for look in judge.looks],
    }
    write_text(options.output / CURVE, json.dumps(curve, indent=1) + "\n")
    file = ControllerFile(
        OwnNetwork(NETWORK),
        judge.genome,
        TaskParameters(),
        Origin(
            KINEMATIC_ROBOT,
            ARENA,
            START_CLEARANCE,
            made_by["mjcf_sha256"],
            made_by["own_sha256"],
        ),
        {"validation": judge.champion},
    )
    write_text(options.output / CHAMPION, file.to_json())
    write_text(options.output / "provenance.json", to_json(made_by))


if __name__ == "__main__":
    main(tyro.cli(Options))

"""What simulation makes of a policy on an emulated robot: what the bridge has to equal.

`same_times` takes from the robot's journal *when* commands came and sensors were read,
and nothing else: observations, actions, commands and motion are its own, by
`robots_in` and the functions that evolution uses. `nominal` takes nothing:
control steps all alike, sensors read at their ends, motors never late.

Both quantise as the robot does: whole counts, whole steps/s, whole ticks a step.
"""

from dataclasses import replace

import numpy as np

from epuck_mj.bridge.fake.motors_and_sensors import MotorTimer, Wheel
from epuck_mj.bridge.fake.simulated_body import Journal
from epuck_mj.rungs.disturbed import DisturbedRobots
from epuck_mj.rungs.table import robots_in
from epuck_mj.scene.model import Scene
from epuck_mj.step.control import Policy, TaskParameters, control_step
from epuck_mj.step.disturbances import Noise, draw_disturbances
from epuck_mj.step.motors import STEP_ANGLE, command, step_rates
from epuck_mj.step.sensors import observe, proximity, sensed_distance

QUIET = Noise(counts=0.0, wheels=0.0, age=0.0)
"""Whole counts and whole steps, and nothing else."""


def same_times(
    scene: Scene,
    policy: Policy,
    task: TaskParameters,
    start: np.ndarray,
    journal: Journal,
    timer: MotorTimer,
) -> np.ndarray:
    """Poses `(steps + 1, 3)` at the journal's physics steps, up to the last reading.

    Args:
        scene: robot and arena.
        policy: called with observations `(8,)`.
        task: what the robot is at.
        start: pose `(3,)`: x, y [m], yaw [rad].
        journal: of the robot, whose host did nothing but drive it.
        timer: of its motors.

    Raises:
        ValueError: if the journal's commands are not as many as the policy's.
    """
    robots = robots_in(replace(scene, n_substeps=1), 1, 1)
    distances = [robots.reset(start[None]).distance[0]]
    poses = [robots.poses()[0]]
    wheels, pauses = (Wheel(0.0, 0.0),) * 2, np.zeros(2)
    timestep = scene.model.opt.timestep
    told = iter([journal.sample_step[sample] for sample in journal.told])
    drives = [k for k, row in enumerate(journal.command) if row[0] or row[2]]
    commands = iter(journal.command_step[drives[0] :])

    def advance(n_steps: int) -> None:
        nonlocal pauses
        while len(poses) <= n_steps:
            held = np.minimum(pauses, timestep)
            pauses = pauses - held
            share = (timestep - held) / timestep
            speeds = np.array([wheel.rate for wheel in wheels]) * share * STEP_ANGLE
            distances.append(robots.step(speeds[None]).distance[0])
            poses.append(robots.poses()[0])

    before, sensed = (0, 0), next(told)
    advance(sensed)
    while True:
        counts = np.rint(proximity(distances[sensed]))
        observation = observe(sensed_distance(counts), task.sensor_range)
        wanted = step_rates(command(policy(observation), task.speeds))
        rates = (int(wanted[0]), int(wanted[1]))
        try:
            if rates != before:
                advance(next(commands))
                left, right = map(timer.wheel, rates, before)
                wheels, pauses = (left, right), np.array([left.pause, right.pause])
                before = rates
                # the answer to a command is a reading nobody decides on
                next(told)
            sensed = next(told)
        except StopIteration:
            return np.array(poses[: sensed + 1])
        advance(sensed)


def nominal(
    scene: Scene,
    policy: Policy,
    task: TaskParameters,
    start: np.ndarray,
    n_steps: int,
) -> np.ndarray:
    """Poses `(n_steps + 1, 3)` at the ends of control steps that nothing disturbs.

    Args:
        scene: robot and arena.
        policy: called with observations `(8,)`.
        task: what the robot is at.
        start: pose `(3,)`: x, y [m], yaw [rad].
        n_steps: control steps.
    """
    met = draw_disturbances(np.random.default_rng(0), 1, n_steps, QUIET)
    robots = DisturbedRobots(robots_in(scene, 1, 1), met, task.control_step)
    observation = observe(robots.reset(start[None]).distance, task.sensor_range)
    poses = [robots.poses()[0]]
    for k in range(n_steps):
        step = control_step(robots, policy, observation, task, k)
        observation = step.observation
        poses.append(robots.poses()[0])
    return np.array(poses)


def drive_steps(journal: Journal) -> list[int]:
    """Physics steps made when each command came that moved the robot."""
    rows = zip(journal.command_step, journal.command, strict=True)
    return [step for step, row in rows if row[0] or row[2]]


def at_control_steps(scene: Scene, journal: Journal, n_steps: int) -> np.ndarray:
    """Poses `(n, 3)` from the first command on, a control step apart."""
    first = drive_steps(journal)[0]
    return np.array(journal.pose)[first :: scene.n_substeps][: n_steps + 1]


def deviation(poses: np.ndarray, others: np.ndarray) -> tuple[float, float]:
    """Largest distance [m] and difference of direction [rad] of poses `(n, 3)`."""
    moved = np.linalg.norm(poses[:, :2] - others[:, :2], axis=1)
    turned = np.abs((poses[:, 2] - others[:, 2] + np.pi) % (2 * np.pi) - np.pi)
    return float(moved.max()), float(turned.max())

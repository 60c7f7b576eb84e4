"""The table of rungs, the only way to a simulator.

A rung belongs to a robot's name, since it changes results. Another one is a module with
a `Simulator` and a line in `RUNGS`.
"""

from collections.abc import Callable, Mapping

from epuck_mj.rungs.mujoco_batch import MujocoRobots
from epuck_mj.rungs.simulator import Simulator
from epuck_mj.scene.model import Scene

RUNGS: Mapping[str, Callable[[Scene, int, int], Simulator]] = {
    "epuck": MujocoRobots,
    "epuck_planar": MujocoRobots,
}
"""Makers of simulators by the robot's name; other robots use MuJoCo."""


def robots_in(scene: Scene, capacity: int, threads: int = 0) -> Simulator:
    """Robots of a scene, in the simulator that belongs to their name.

    Args:
        scene: robot and arena.
        capacity: the most robots that a reset can place.
        threads: threads that step them; 0 is one per core.
    """
    return RUNGS.get(scene.robot.stem, MujocoRobots)(scene, capacity, threads)

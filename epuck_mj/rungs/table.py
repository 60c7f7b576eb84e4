"""The table of rungs, the only way to a simulator.

A rung belongs to a robot's name, since it changes results. Another one is a module with
a `Simulator` and an entry in `RUNGS`; another shipped robot, kinematic and on wheels,
is a line in `model_files.ON_WHEELS`.
"""

from collections.abc import Callable, Mapping

from epuck_mj.rungs.mujoco_batch import MujocoRobots
from epuck_mj.rungs.simulator import CompiledTrials, Simulator
from epuck_mj.scene.model import Scene
from epuck_mj.scene.model_files import ROBOT_FILES, is_kinematic
from epuck_mj.step.control import TaskParameters


def _kinematic(scene: Scene, capacity: int, threads: int) -> Simulator:
    # numba is slow to import
    from epuck_mj.rungs.kinematic.robots import KinematicRobots

    return KinematicRobots(scene, capacity, threads)


RUNGS: Mapping[str, Callable[[Scene, int, int], Simulator]] = {
    name: _kinematic if is_kinematic(name) else MujocoRobots for name in ROBOT_FILES
}
"""Makers of simulators by the robot's name; other robots use MuJoCo.

A kinematic robot climbs to the one on wheels behind it: see `model_files.ON_WHEELS`.
"""


def robots_in(scene: Scene, capacity: int, threads: int = 0) -> Simulator:
    """Robots of a scene, in the simulator that belongs to their name.

    Args:
        scene: robot and arena.
        capacity: the most robots that a reset can place.
        threads: threads that step them; 0 is one per core.
    """
    return RUNGS.get(scene.name, MujocoRobots)(scene, capacity, threads)


def compiled_trials(
    scene: Scene, task: TaskParameters, threads: int = 0, late: int = 0
) -> CompiledTrials | None:
    """Whole trials of shipped networks in compiled code, with the same bits.

    None where there are none: on other rungs, and for a user's own step fitness.

    Args:
        scene: robot and arena.
        task: what a trial is.
        threads: that run trials; 0 is one per core.
        late: control steps until a command has reached the wheels of ideal robots.
    """
    if not is_kinematic(scene.name):
        return None
    from epuck_mj.rungs.kinematic.fused import FusedTrials
    from epuck_mj.rungs.kinematic.whole_trial import FITNESS

    if task.fitness not in FITNESS:
        return None
    return FusedTrials(scene, task, threads, late)

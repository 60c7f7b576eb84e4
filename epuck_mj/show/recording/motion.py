"""Motion in the arena: the robot's bodies, path, rays and crash."""

import numpy as np
import rerun as rr

from epuck_mj.scene.geometry import kinematics, moving_bodies
from epuck_mj.scene.model import Scene
from epuck_mj.scene.robot_parts import ROBOT_BODY
from epuck_mj.show.colors import HIGH_FITNESS, LOW_FITNESS, VERMILION, blend
from epuck_mj.show.rays import ray_lines
from epuck_mj.show.recording.entities import EARNED, SENSED, Entities, columns
from epuck_mj.show.recording.shapes import body_name
from epuck_mj.trials.trajectory import Trajectory

PATH_HEIGHT = 0.003
"""Height of the path above the robot's origin [m], to lie on the floor."""

MARK_HEIGHT = 0.07
"""Height of a crash's mark above the robot [m]."""


def log_motion(
    stream: rr.RecordingStream,
    scene: Scene,
    trajectory: Trajectory,
    sensor_range: float,
    place: Entities,
) -> None:
    """Log a trajectory in space; bodies and rays in world coordinates."""
    model = scene.model
    now = columns(trajectory, SENSED)
    position, quaternion, *_ = kinematics(scene, trajectory.pose)
    for body in moving_bodies(model):
        poses = rr.Transform3D.columns(
            translation=position[:, body],
            # MuJoCo says wxyz, rerun xyzw
            quaternion=quaternion[:, body][:, [1, 2, 3, 0]],
        )
        stream.send_columns(place.body(body_name(model, body)), now, poses)

    root = position[:, model.body(ROBOT_BODY).id] + [0, 0, PATH_HEIGHT]
    path = rr.LineStrips3D.columns(
        strips=np.stack([root[:-1], root[1:]], axis=1, dtype=np.float32),
        colors=blend(LOW_FITNESS, HIGH_FITNESS, trajectory.fitness),
        radii=np.full(trajectory.steps, 0.002),
    )
    stream.send_columns(place.path, columns(trajectory, EARNED), path)

    lines, colors = ray_lines(scene, trajectory, sensor_range)
    ends = rr.LineStrips3D.columns(
        strips=lines.reshape(-1, 2, 3).astype(np.float32),
        colors=colors.reshape(-1, 3),
        radii=np.full(colors.size // 3, 0.001),
    )
    counts = np.full(len(lines), lines.shape[1])
    stream.send_columns(place.rays, now, ends.partition(counts))

    if trajectory.crashed:
        mark = rr.Points3D.columns(
            positions=root[-1:] + np.array([0, 0, MARK_HEIGHT]),
            radii=[0.012],
            colors=[VERMILION],
            labels=["crash"],
        )
        stream.send_columns(place.crash, columns(trajectory, slice(-1, None)), mark)

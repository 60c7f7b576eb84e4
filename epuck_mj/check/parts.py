"""Findings about a robot's sensors and actuators at a start."""

import mujoco
import numpy as np

from epuck_mj.check.findings import Finding, info
from epuck_mj.constants import PROXIMITY_RANGE
from epuck_mj.scene.model import Scene
from epuck_mj.scene.robot_parts import PREFIX

_SENSOR = mujoco.mjtSensor

UNITS = {
    _SENSOR.mjSENS_RANGEFINDER: f" m (controllers see up to {PROXIMITY_RANGE:.2f} m)",
    _SENSOR.mjSENS_CONTACT: " contacts",
    _SENSOR.mjSENS_GYRO: " rad/s",
    _SENSOR.mjSENS_VELOCIMETER: " m/s",
    _SENSOR.mjSENS_ACCELEROMETER: " m/s^2",
}
"""Units of common kinds of sensors."""


def part_findings(scene: Scene, start: np.ndarray, topic: str) -> list[Finding]:
    """Sensor values and actuators of a robot at rest on a start `(3,)`."""
    model, data = scene.model, mujoco.MjData(scene.model)
    data.qpos[:] = scene.qpos(start)
    mujoco.mj_forward(model, data)
    x, y, yaw = start
    where = f"start: x {x:.3f} m, y {y:.3f} m, heading {np.degrees(yaw):.0f} deg"
    readings: dict[int, list[str]] = {}
    for sensor in range(model.nsensor):
        kind = int(model.sensor_type[sensor])
        name = model.sensor(sensor).name.removeprefix(PREFIX)
        address, size = model.sensor_adr[sensor], model.sensor_dim[sensor]
        values = data.sensordata[address : address + size]
        readings.setdefault(kind, []).append(f"{name} {_shown(kind, values)}".strip())
    sensors = [
        info(
            topic,
            f"{_SENSOR(kind).name.removeprefix('mjSENS_').lower()}: "
            f"{', '.join(shown)}{UNITS.get(_SENSOR(kind), '')}",
        )
        for kind, shown in readings.items()
    ]
    actuators = []
    for actuator in range(model.nu):
        low, high = model.actuator_ctrlrange[actuator]
        limits = (
            f" {low:.2f} to {high:.2f}" if model.actuator_ctrllimited[actuator] else ""
        )
        name = model.actuator(actuator).name.removeprefix(PREFIX)
        # of a velocity servo: the speed that it is told to keep
        speed = data.actuator_velocity[actuator]
        actuators.append(f"{name}{limits}, now {speed:.2f}")
    driven = f"actuators: {'; '.join(actuators)}"
    return [info(topic, where), *sensors, info(topic, driven)]


def _shown(kind: int, values: np.ndarray) -> str:
    """A sensor's value as text."""
    if kind == _SENSOR.mjSENS_RANGEFINDER and values[0] < 0:
        return "nothing"
    digits = 0 if kind == _SENSOR.mjSENS_CONTACT else 3
    # no -0.000
    return " ".join(f"{round(float(value), digits) + 0:.{digits}f}" for value in values)

"""Changes of the kinematic robot: one number that differs."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from epuck_mj.constants import BODY_RADIUS
from epuck_mj.scene.changed_robots import with_body_radius, with_sensors_set_back
from epuck_mj.scene.model import Scene


@dataclass(frozen=True)
class Change:
    """One number of the robot that is changed.

    Attributes:
        title: what it is, for readers, with the unit.
        own: its amount on the robot of evolution.
        amounts: those that are tried, ascending, in that unit.
        scene: gives the changed scene of a scene and an amount.
        late: whether the amount is a latency instead.
    """

    title: str
    own: float
    amounts: tuple[float, ...]
    scene: Callable[[Scene, float], Scene]
    late: bool = False


MILLIMETRES = 1000

CHANGES: Mapping[str, Change] = {
    "body_radius": Change(
        "radius of the body [mm]",
        BODY_RADIUS * MILLIMETRES,
        (34, 34.5, 35, 35.5, 36, 36.5, 37, 37.5, 38),
        lambda scene, mm: with_body_radius(scene, mm / MILLIMETRES),
    ),
    "sensors_set_back": Change(
        "sensors set back by [mm]",
        0,
        (0, 0.5, 1, 1.5, 2, 2.5, 3),
        lambda scene, mm: with_sensors_set_back(scene, mm / MILLIMETRES),
    ),
    "latency": Change(
        "commands late by [control steps]",
        0,
        (0, 1, 2),
        lambda scene, _: scene,
        late=True,
    ),
}
"""The changes by name."""

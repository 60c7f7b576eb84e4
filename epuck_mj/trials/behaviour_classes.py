"""Behaviour classes: one name per trial for the robot's behaviour.

The first class of the table that fits is the trial's. Failures come first: a robot
that ends in a wall or in a corner is no wall follower, however well it began. Then
come trials that follow walls, then trials that do something else.
"""

from collections.abc import Callable
from types import MappingProxyType

import numpy as np

from epuck_mj.constants import BODY_RADIUS, PROXIMITY_RANGE
from epuck_mj.trials.metrics import (
    FOLLOWING_SHARE,
    FOLLOWING_SPEED,
    FOLLOWING_TIME,
    LAST_TIME,
    Behaviour,
)

SPOT = BODY_RADIUS
"""Farthest that a robot on the spot gets from its start [m]."""

ROUND = 2 * np.pi
"""Least turn of spinners and circlers [rad]: one full turn."""

CIRCLER_NEAR_WALL = 0.5
"""Largest share of time near walls of a circler, which circles in the open."""

HUG = 0.005
"""Clearance below which a follower hugs [m]: less than a real robot's errors."""

BOUNCES = 3
"""Least visits to walls of a bouncer: an odd start and a search make only two."""

OTHER = "other"

CLASSES: MappingProxyType[str, Callable[[Behaviour], np.ndarray]] = MappingProxyType(
    {
        # a crash, whatever the robot did before it
        "crashed": lambda b: b.crashed,
        # on one spot for the whole trial, turning
        "spinner": lambda b: (b.reach < SPOT) & (np.abs(b.turn) >= ROUND),
        # at last on one spot: in a corner, before a wall, or from the start on
        "stuck": lambda b: b.reach_at_end < SPOT,
        # a wall follower so close to the wall that a real robot would touch it
        "hugger": lambda b: b.follows & (b.clearance_mean < HUG),
        "wall follower": lambda b: b.follows,
        # round and round, no more than one visit to a wall each time
        "circler": lambda b: (
            (np.abs(b.turn_in_open) >= ROUND)
            & (b.share_near_wall < CIRCLER_NEAR_WALL)
            & (b.visits <= np.abs(b.turn) / ROUND + 1)
        ),
        # from wall to wall
        "bouncer": lambda b: b.visits >= BOUNCES,
        # met no wall, or too late to tell what it does there
        "searcher": lambda b: ~(b.time - b.time_to_first_wall >= FOLLOWING_TIME),
    }
)
"""Name and predicate of each class, in order of precedence; the rest is `other`."""

MEANINGS: MappingProxyType[str, str] = MappingProxyType(
    {
        "crashed": "the shell touched a wall, whatever the robot did before",
        "spinner": "turned for the whole trial, less than "
        f"{SPOT * 1000:.0f} mm from its start",
        "stuck": f"was less than {SPOT * 1000:.0f} mm from its end for its last "
        f"{LAST_TIME:.0f} s",
        "hugger": f"a wall follower with a mean clearance below {HUG * 1000:.0f} mm",
        "wall follower": f"within {PROXIMITY_RANGE * 1000:.0f} mm of walls for at "
        f"least {FOLLOWING_SHARE:.0%} of the time since the first wall, which is at "
        f"least {FOLLOWING_TIME:.0f} s, and making progress along walls at "
        f"{FOLLOWING_SPEED:.0%} of the top speed or faster",
        "circler": "drove round in the open, with at most one visit to a wall a round",
        "bouncer": f"drove from wall to wall, with at least {BOUNCES} visits",
        "searcher": "met no wall, or met one too late to tell what it does there",
        OTHER: "none of these",
    }
)
"""Meanings of the classes in words."""


def behaviour_classes(behaviour: Behaviour) -> np.ndarray:
    """Name of the class of each trial, `(n,)`."""
    masks = [fits(behaviour) for fits in CLASSES.values()]
    return np.select(masks, list(CLASSES), OTHER)


def class_shares(behaviour: Behaviour) -> dict[str, float]:
    """Share of the trials that each class has, in order of precedence; sums to 1."""
    classes = behaviour_classes(behaviour)
    return {name: float((classes == name).mean()) for name in (*CLASSES, OTHER)}

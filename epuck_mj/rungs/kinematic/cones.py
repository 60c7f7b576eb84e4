"""Compiled sensors with three rays; see `step.cones`."""

from epuck_mj.rungs.kinematic.compiling import compiled
from epuck_mj.rungs.kinematic.elementary import exp, interpolate, log
from epuck_mj.step.sensors import LOG_COUNTS, PROXIMITY_DISTANCES, PROXIMITY_REACH

NEARER_LAST = PROXIMITY_DISTANCES[::-1].copy()
MORE_LAST = LOG_COUNTS[::-1].copy()
"""Distances [m] of counts, and the counts' logarithms: these grow."""


@compiled(forceinline=True)
def proximity(distance):
    """Counts of one ray; see `sensors.proximity`."""
    if 0.0 <= distance <= PROXIMITY_REACH:
        return exp(interpolate(distance, PROXIMITY_DISTANCES, LOG_COUNTS))
    return 0.0


@compiled()
def widen(cosines, aside, distance):
    """Put what cones measure in the place of their middle rays' distances [m].

    Args:
        cosines: of the angles in the cones, `(8,)`.
        aside: distances along all rays to the left, then to the right, `(16,)`.
        distance: along the middle rays, `(8,)`; changed.
    """
    n = distance.shape[0]
    for k in range(n):
        middle = distance[k]
        own = proximity(middle) - 2.0 * proximity(middle / cosines[k])
        counts = proximity(aside[k]) + own + proximity(aside[n + k])
        distance[k] = -1.0
        if counts > 0.0:
            distance[k] = interpolate(log(max(counts, 1.0)), MORE_LAST, NEARER_LAST)

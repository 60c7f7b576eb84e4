"""Cones: what a sensor with three rays measures, as one distance.

A real sensor sees a cone. What the ray in its middle passes by, one to its left or to
its right may meet. `rungs.kinematic.cones` has the same operations in the same order.
"""

import numpy as np

from epuck_mj.step.sensors import proximity, sensed_distance


def cone_distance(
    middle: np.ndarray, left: np.ndarray, right: np.ndarray, cosines: np.ndarray
) -> np.ndarray:
    """Distance at which one ray counts as much as three together [m], `(..., 8)`.

    Negative where they count nothing. The middle ray counts so that a flat wall faced
    squarely is as far as for one ray. So a thing that the middle ray alone meets counts
    nothing, and an edge between two rays counts little.

    Args:
        middle: metres along the middle ray, `(..., 8)`; negative is "nothing hit".
        left: along the ray to its left, likewise.
        right: along the ray to its right, likewise.
        cosines: of the angle between the middle ray and each of the others, `(8,)`.

    Source: Enki, `EPuck.cpp`: r(left) + (r(middle) - 2 r(middle / cos)) + r(right),
    with the counts of `sensors.proximity` as r.
    """
    own = proximity(middle) - 2.0 * proximity(middle / cosines)
    counts = proximity(left) + own + proximity(right)
    return np.where(counts > 0, sensed_distance(counts), -1.0)

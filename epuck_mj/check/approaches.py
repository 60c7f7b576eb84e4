"""Places on the outlines of things where a robot can touch them, headed at them."""

from collections.abc import Iterator

import numpy as np
from scipy import ndimage

from epuck_mj.constants import BODY_RADIUS
from epuck_mj.scene.model import Scene
from epuck_mj.scene.outline import geom_outlines
from epuck_mj.scene.starts import Grid
from epuck_mj.step.control import START_CLEARANCE

STEP = 0.005
"""Distance of the places on an outline that are tried [m]."""

FINE_STEP = 0.0005
"""The same on sides so short that rays may pass on both of their ends [m]."""

SHORT = 0.04
"""Length of such sides [m]."""

SIDE_MIN = 0.0001
"""Shortest side whose places are tried [m]; its ends are."""

PLACES_MAX = 50_000
"""Most places that are tried in an arena."""


def approaches(
    scene: Scene, grid: Grid, geoms: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Indices `(n,)` of geoms and poses `(n, 3)` that touch their outlines."""
    # a robot that touches is nearer to walls than it may start
    reach = int(np.ceil(START_CLEARANCE / grid.spacing)) + 1
    near = np.asarray(ndimage.binary_dilation(grid.inside, np.ones((3, 3)), reach))
    found, numbers = [], []
    outlines = geom_outlines(scene, geoms)
    for geom, outline in zip(np.flatnonzero(geoms).tolist(), outlines, strict=True):
        poses = np.concatenate(list(_around(outline)))
        node = np.round((poses[:, :2] - grid.origin) / grid.spacing).astype(int)
        # outside of the grid, it is its edge that counts
        x, y = np.clip(node, 0, np.array(near.shape) - 1).T
        there: np.ndarray = near[x, y]
        found.append(poses[there])
        numbers.append(np.full(there.sum(), geom))
    index, poses = np.concatenate(numbers), np.concatenate(found)
    stride = max(1, -(-len(poses) // PLACES_MAX))
    return index[::stride], poses[::stride]


def _around(outline: np.ndarray) -> Iterator[np.ndarray]:
    """Poses `(n, 3)` that touch a convex outline `(points, 2)`, headed at it."""
    angles = np.linspace(0, 2 * np.pi, len(outline), endpoint=False)
    yield _headed(outline, angles)
    for start, end in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        length = float(np.hypot(*(end - start)))
        if length > SIDE_MIN:
            n = 2 + int(length / (FINE_STEP if length < SHORT else STEP))
            share = np.linspace(0, 1, n)[:, None]
            along = np.arctan2(*(end - start)[::-1])
            # counterclockwise: outside is on the right
            yield _headed(start + share * (end - start), np.full(n, along - np.pi / 2))


def _headed(points: np.ndarray, outward: np.ndarray) -> np.ndarray:
    normal = np.stack([np.cos(outward), np.sin(outward)], axis=1)
    yaw = np.arctan2(-normal[:, 1], -normal[:, 0])
    return np.concatenate([points + BODY_RADIUS * normal, yaw[:, None]], axis=1)

"""A hand-written wall follower, a yardstick for evolved controllers.

It keeps walls on its right. Its few numbers were chosen by hand in the paper's arena.
"""

import numpy as np

YARDSTICK = "wall-follower"
"""Name of the hand-written wall follower, among champions and among experiments."""

BEHIND, RIGHT, RIGHT_DIAGONAL = 3, 2, 1
AHEAD = (0, 6, 7)
"""Indices of the front right, left diagonal and front left sensor."""

CLEAR_AHEAD = 0.95
"""Observation below which there is a wall ahead."""

TARGET = 0.5
"""Right-diagonal observation to keep: about 7 mm from the wall, driving along it."""

GAIN = 1.5
TURN_MAX = 0.4


class WallFollower:
    """A policy without weights or memory; a batch policy of any size as well."""

    def __call__(self, observation: np.ndarray) -> np.ndarray:
        """Actions `(..., 2)` for observations `(..., 8)`."""
        blocked = observation[..., AHEAD].min(axis=-1) < CLEAR_AHEAD
        side = observation[..., (RIGHT_DIAGONAL, RIGHT, BEHIND)].min(axis=-1)
        turn = np.clip(
            GAIN * (observation[..., RIGHT_DIAGONAL] - TARGET), -TURN_MAX, TURN_MAX
        )
        # straight on without a wall; turn left on the spot if a wall is ahead
        turn = np.where(side < 1, turn, 0.0)
        forward = np.where(blocked, 0.0, 1.0)
        return np.stack([forward, np.where(blocked, -1.0, turn)], axis=-1)

    def __getitem__(self, index: object) -> "WallFollower":
        """The policy itself, as all members of the batch are alike."""
        return self

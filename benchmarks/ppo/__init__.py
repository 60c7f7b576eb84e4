"""PPO of stable-baselines3 on the vector environment, beside evolution."""

CURVE, TEST = "curve.json", "test.json"
"""Files of a training: how fitness grew, and what `evolution.evaluate --json` found."""

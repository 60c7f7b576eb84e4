"""Scenes: MJCF compiled to a model, with its geometry and starts."""

"""Measurements: what the physics step costs, and what it may cost."""

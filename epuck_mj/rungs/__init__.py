"""Rungs: the simulators by which a robot moves, and their table."""

"""Evolve controllers for the e-puck: optimisers, experiments, command lines."""

# first of all: it prepares commands for what may happen while they load
import epuck_mj  # noqa: F401

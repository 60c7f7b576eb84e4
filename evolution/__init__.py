"""Evolve controllers for the e-puck: optimisers, experiments, command lines."""

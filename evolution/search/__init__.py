"""Optimisers: ask for genomes, tell their fitness; one file an algorithm."""

"""Judging: evaluation of genomes, held-out tests, scores."""

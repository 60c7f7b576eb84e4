"""Variations: the paper's three algorithms with one thing changed at a time."""

"""Whether the rungs of the ladder tell the truth, and where they do not."""

"""What a genome is worth: evaluation, held-out tests, scores."""

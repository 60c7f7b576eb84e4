"""What an experiment is: its config, its files, its randomness."""

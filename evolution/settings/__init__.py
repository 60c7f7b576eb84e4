"""Settings of experiments: config, files and randomness."""

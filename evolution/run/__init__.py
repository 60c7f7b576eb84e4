"""One run of evolution and its directory: `python -m evolution.run`."""

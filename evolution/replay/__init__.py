"""Replay: `python -m evolution.replay PATH [options]`."""

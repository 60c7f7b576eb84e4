"""Runs compared with what they were made from: `python -m evolution.verify`."""

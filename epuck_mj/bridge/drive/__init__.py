"""Drives a real robot: sensing, policy, speeds, schedule and log."""

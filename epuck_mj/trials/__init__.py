"""Trials recorded, measured and put into behaviour classes."""

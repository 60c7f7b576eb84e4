"""Checks of an arena: `python -m epuck_mj.check my.xml`."""

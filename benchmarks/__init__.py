"""Measurements of speed, memory and agreement; the Makefile has their commands."""

from epuck_mj.host.loading import set_environment

set_environment()

"""By which physics a robot moves: the simulators and their table."""

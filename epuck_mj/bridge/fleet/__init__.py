"""A fleet: several robots that drive at once, each by a process of its own.

`members` says who belongs to it. `driver` is the process of one robot; `crew` is all of
them, as the command sees them. `screen` shows a line for each robot. `fleet_drive` is
a whole drive of a fleet, from the first greeting to the last picture.
"""

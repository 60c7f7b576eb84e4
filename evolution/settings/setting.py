"""Setting: arena, task and start clearance of trials."""

from dataclasses import dataclass

from epuck_mj.step.control import TaskParameters


@dataclass(frozen=True)
class Setting:
    """Arena, task and start clearance: fitness is comparable where these are equal.

    Attributes:
        arena: name of a shipped arena, or path of its MJCF.
        task: what a trial is.
        start_clearance: least distance from the shell to a wall at a start [m].
    """

    arena: str
    task: TaskParameters
    start_clearance: float

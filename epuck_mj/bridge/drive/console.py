"""What a bridge prints of a drive: a status line, and a summary."""

import numpy as np

from epuck_mj.bridge.drive.robot import RealRobot
from epuck_mj.bridge.drive.session import Session, Step
from epuck_mj.step.fitness import of_most

QUIET_PERIOD = 1.0
"""Time between two status lines of a robot where output is no terminal [s]."""


def live_line(step: Step, robot: RealRobot) -> str:
    """Status of a control step in less than 80 characters: counts, speeds, timing.

    Speeds are those sent; of a dry run, those that would have been.
    """
    counts = " ".join(f"{count:4.0f}" for count in step.moment.proximity)
    left, right = robot.told(step.control.command)
    return (
        f"{step.moment.time:5.1f} s ps {counts} D {left:5d} {right:5d} "
        f"{step.moment.latency * 1000:3.0f} ms {robot.schedule.n_overruns} over"
    )


HEADING = (
    " time    proximity counts ps0 to ps7              wheels steps/s  "
    "latency, overruns"
)


def fleet_line(step: Step, robot: RealRobot) -> str:
    """Status of a control step beside a robot's name, in less than 70 characters."""
    counts = " ".join(f"{count:4.0f}" for count in step.moment.proximity)
    left, right = robot.told(step.control.command)
    return (
        f"{step.moment.time:5.1f} s {counts} {left:5d} {right:5d} "
        f"{robot.schedule.n_overruns:3d}"
    )


FLEET_HEADING = " time   proximity counts ps0 to ps7             wheels steps/s  late"


def drive_summary(session: Session, robot: RealRobot) -> str:
    """Summary of a session, one fact per line."""
    steps = session.steps
    fitness = sum(float(step.control.fitness) for step in steps)
    lines = [
        f"control steps  {len(steps)}, {robot.schedule.n_overruns} overruns, "
        f"{robot.n_repairs} resynchronisations"
    ]
    if steps:
        most = session.task.most_in(len(steps))
        latency = 1000 * np.array([step.moment.latency for step in steps])
        compute = 1000 * np.array([step.compute for step in steps])
        lines += [
            f"latency        median {np.median(latency):.1f} ms, 95 % "
            f"{np.percentile(latency, 95):.1f} ms, longest {latency.max():.1f} ms",
            f"compute        95 % {np.percentile(compute, 95):.2f} ms a step",
            f"odometry       {robot.odometry.length:.3f} m",
            f"fitness        {of_most(fitness, most)}, estimated",
        ]
    return "\n".join(lines)


def fleet_summary(session: Session, robot: RealRobot) -> str:
    """Summary of a session on one line."""
    steps = session.steps
    fitness = sum(float(step.control.fitness) for step in steps)
    worth = of_most(fitness, session.task.most_in(len(steps))) if steps else "0"
    return (
        f"{len(steps)} control steps, {robot.schedule.n_overruns} too long, "
        f"{robot.odometry.length:.2f} m, fitness {worth}"
    )

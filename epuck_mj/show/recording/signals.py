"""Signals of a trajectory: plots, and the lane of phases."""

from dataclasses import dataclass

import numpy as np
import rerun as rr

from epuck_mj.constants import N_PROXIMITY
from epuck_mj.show.colors import (
    BLUE,
    FAINT,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    YELLOW,
)
from epuck_mj.show.recording.entities import DECIDED, EARNED, SENSED, Entities, columns
from epuck_mj.trials.phases import CORNERING, CRASHED, FOLLOWING, SEARCHING, phases
from epuck_mj.trials.trajectory import Trajectory

SENSORS = tuple(f"ps{i}" for i in range(N_PROXIMITY))

RAINBOW = (GREY, ORANGE, SKY, GREEN, YELLOW, BLUE, VERMILION, PURPLE)

PHASE_COLORS = {
    SEARCHING: FAINT,
    FOLLOWING: GREEN,
    CORNERING: ORANGE,
    CRASHED: VERMILION,
}


@dataclass(frozen=True, eq=False)
class Signal:
    """Values over time.

    Attributes:
        values: `(rows, series)`.
        names: of the series.
        rows: of what is sensed at which there are values.
    """

    values: np.ndarray
    names: tuple[str, ...]
    rows: slice


def signals(trajectory: Trajectory, clearance: np.ndarray) -> dict[str, Signal]:
    """All signals of a trajectory by name; of a network only where there is one."""
    # as neurons put it out: w = 2 output - 1
    output = trajectory.action * [1, 0.5] + [0, 0.5]
    hidden = tuple(f"h{i}" for i in range(trajectory.hidden.shape[1]))
    network = np.concatenate([trajectory.hidden, output], axis=1)
    all_signals = {
        "observation": Signal(trajectory.observation, SENSORS, SENSED),
        "proximity": Signal(trajectory.proximity, SENSORS, SENSED),
        "network": Signal(network, (*hidden, "v", "w"), DECIDED),
        "action": Signal(trajectory.action, ("v", "w"), DECIDED),
        "command": Signal(trajectory.command, ("left", "right"), DECIDED),
        "clearance": Signal(1000 * clearance[:, None], ("clearance",), SENSED),
        "step_fitness": Signal(trajectory.fitness[:, None], ("step fitness",), EARNED),
        "cumulative_fitness": Signal(
            trajectory.cumulative_fitness[:, None], ("cumulative fitness",), EARNED
        ),
    }
    if not hidden:
        del all_signals["network"]
    return all_signals


def log_signals(
    stream: rr.RecordingStream,
    trajectory: Trajectory,
    clearance: np.ndarray,
    place: Entities,
) -> None:
    """Log a trajectory's signals and phases.

    Args:
        stream: where to.
        trajectory: what happened.
        clearance: of each pose [m], `(T + 1,)`.
        place: the trial's.
    """
    for name, signal in signals(trajectory, clearance).items():
        entity, names, colors = place.signal(name), signal.names, RAINBOW
        if len(names) == 2:
            colors = (BLUE, VERMILION)
        elif len(names) == 1:
            colors = (GREEN if place.alone else place.color,)
            names = names if place.alone else (place.name,)
        width = len(names)
        style = rr.SeriesLines(names=names, colors=colors[:width], widths=[1.5] * width)
        stream.log(entity, style, static=True)
        scalars = rr.Scalars.columns(scalars=signal.values.ravel())
        scalars = scalars.partition(np.full(len(signal.values), width))
        stream.send_columns(entity, columns(trajectory, signal.rows), scalars)
    _log_phases(stream, trajectory, phases(trajectory, clearance), place)


def _log_phases(
    stream: rr.RecordingStream,
    trajectory: Trajectory,
    phase: np.ndarray,
    place: Entities,
) -> None:
    """Log each phase at its beginning."""
    names = list(PHASE_COLORS)
    style = rr.StateConfiguration(
        values=names, labels=names, colors=list(PHASE_COLORS.values())
    )
    stream.log(place.phase, style, static=True)
    begins = np.flatnonzero(np.concatenate([[True], phase[1:] != phase[:-1]]))
    lane = rr.StateChange.columns(state=phase[begins].tolist())
    stream.send_columns(place.phase, columns(trajectory, begins), lane)

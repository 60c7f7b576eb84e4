"""Live view: a run in a rerun viewer, by a process of its own.

Evolution hands its records over and never waits: generations for which a slow viewer
has no time are left out, and a viewer that is closed does not stop the run.
"""

import multiprocessing
import os
import queue
import socket
import sys
import time
import traceback
from contextlib import suppress
from multiprocessing.process import parent_process
from typing import Any, Self

import numpy as np

from epuck_mj.errors import UserError
from epuck_mj.host.command_line import shell_command
from epuck_mj.host.interruption import deaf_to_interrupts
from epuck_mj.scene.model import load_scene
from epuck_mj.scene.model_files import on_wheels
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.trials.recorder import record
from evolution.judging.held_out_starts import (
    held_out_disturbances,
    starts_for_test,
)
from evolution.run.generation_loop import Evolution
from evolution.run.history import Record
from evolution.settings.config import ExperimentConfig
from evolution.settings.randomness import Purpose

HOST, PORT = "127.0.0.1", 9876
"""Where rerun's viewer listens."""

BACKLOG = 10_000
"""Generations that may wait for the viewer."""

PAUSE = 1.0
"""Least time between two trials [s], so that they can be watched."""

PATIENCE = 5.0
"""How long the viewer's process may take to end [s]."""

Generation = tuple[Record, np.ndarray]
"""Record of a generation, and its best individual's genome."""


class Live:
    """Shows an evolution in a viewer for the block."""

    def __init__(self, evolution: Evolution):
        """Name the evolution, without showing it yet."""
        self._evolution = evolution
        self._shown = 0
        context = multiprocessing.get_context("spawn")
        self._queue: Any = context.Queue(BACKLOG)
        self._process = context.Process(
            target=_show, args=(evolution.config, PORT, self._queue), daemon=True
        )

    def update(self) -> None:
        """Hand over the generations since the last call."""
        evolution = self._evolution
        records = evolution.records[self._shown :]
        genomes = evolution.best_genomes[self._shown :]
        self._shown = len(evolution.records)
        if self._process.is_alive():
            for generation in zip(records, genomes, strict=True):
                self._hand_over(generation)

    def _hand_over(self, generation: Generation | None) -> None:
        with suppress(queue.Full):
            self._queue.put_nowait(generation)

    def __enter__(self) -> Self:
        """Start, with the generations that a resumed run already has."""
        # Ctrl-C is the run's business
        with deaf_to_interrupts():
            self._process.start()
        self.update()
        return self

    def __exit__(self, *exception: object) -> None:
        """Show the remaining generations, if that does not take long."""
        self._hand_over(None)
        self._process.join(PATIENCE)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()
        # the viewer's process has ended
        self._queue.cancel_join_thread()
        self._queue.close()


def require_viewer() -> None:
    """Refuse to start without a viewer that is running.

    Raises:
        UserError: if there is none.
    """
    if not viewer_there(PORT):
        raise UserError(
            f"no rerun viewer at {HOST}:{PORT} for --live; start one first: "
            + shell_command("rerun")
        )


def viewer_there(port: int) -> bool:
    """Whether a viewer listens."""
    try:
        with socket.create_connection((HOST, port), timeout=PAUSE):
            return True
    except OSError:
        return False


def _show(config: ExperimentConfig, port: int, generations: Any) -> None:
    """Main function of the viewer's process."""
    try:
        _follow(config, port, generations)
    except ConnectionError:
        print("The viewer was closed; the run continues", file=sys.stderr)
    except Exception:
        traceback.print_exc()
    # rerun would wait for a closed viewer
    os._exit(0)


def _follow(config: ExperimentConfig, port: int, generations: Any) -> None:
    """Show generations until the run has ended.

    Raises:
        ConnectionError: if the viewer was closed, or accepts nothing.
    """
    # rerun is slow to import
    from epuck_mj.show.recording.live import LiveView

    scene = load_scene(config.robot, config.arena, config.control_step)
    rolling = scene
    if config.climbs:
        wheels = on_wheels(config.robot)
        rolling = load_scene(wheels, config.arena, config.control_step)
    start = starts_for_test(FreeSpace(scene, config.start_clearance), 1)[0]
    # as it evolves: what the first test start meets
    met = held_out_disturbances(config.conditions, Purpose.TEST, 1, config.steps)
    title = f"{config.optimizer.algorithm}, seed {config.seed}"
    address = f"rerun+http://{HOST}:{port}/proxy"
    view = LiveView(address, scene, title, config.steps)
    shown = np.empty(0)
    while batch := _next(generations):
        waited_for = [generation for generation in batch if generation is not None]
        if not viewer_there(port):
            raise ConnectionError
        if waited_for:
            records, genomes = zip(*waited_for, strict=True)
            _add(view, records)
            if not np.array_equal(genomes[-1], shown):
                shown = genomes[-1]
                policy = config.topology.decode(shown)
                driven = rolling if records[-1].climbed else scene
                trajectory = record(driven, policy, start, config.task, met)
                view.trial(
                    records[-1].evaluations,
                    records[-1].generation,
                    trajectory,
                    f"Generation {records[-1].generation}: stored fitness "
                    f"{records[-1].best:.1f}, {trajectory.trial_fitness:.1f} in this "
                    "trial, from a start that evolution never meets",
                )
            view.flush()
        if None in batch:
            view.close()
            return
        time.sleep(PAUSE)


def _next(generations: Any) -> list[Generation | None]:
    """All waiting generations, at least one; none if the run's process has died."""
    batch: list[Generation | None] = []
    while not batch:
        try:
            batch.append(generations.get(timeout=PAUSE))
            while True:
                batch.append(generations.get_nowait())
        except queue.Empty:
            parent = parent_process()
            if parent is None or not parent.is_alive():
                return []
    return batch


def _add(view: Any, records: tuple[Record, ...]) -> None:
    """Add the curves of some generations."""
    view.generations(
        [record.evaluations for record in records],
        [record.generation for record in records],
        np.array([(record.best, record.mean) for record in records]),
        np.array([record.crash_rate for record in records]),
    )

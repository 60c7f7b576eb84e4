"""How far the robots agree: `python -m benchmarks.ladder`, or `make ladder`.

Controllers drive from the same starts on each rung and on the reference: the robot on
wheels with a fifth of its physics step. Figures are written as they are measured; a
measurement that was stopped goes on where it was. Then the page and its picture are
written.
"""

import json
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.convergence import REFINEMENT, held_out_starts
from benchmarks.ladder.controllers import tried
from benchmarks.ladder.page import REFERENCE, write_page
from epuck_mj.host import files
from epuck_mj.host.command_line import main, parse
from epuck_mj.rungs.table import robots_in
from epuck_mj.scene.model import Scene, load_scene
from epuck_mj.step.control import run_trials

ARENAS = {"arena": 1, "l_shape": 3, "pillars": 3, "octagon": 3}
"""Arenas; every controller is measured there (1), or every third one (3)."""


def _reference(arena: str) -> Scene:
    step = load_scene("epuck", arena).model.opt.timestep
    return load_scene("epuck", arena, physics_step=step / REFINEMENT)


def _end_of_step(arena: str) -> Scene:
    """On wheels; a touch that is over at the end of a control step is no crash."""
    return load_scene("epuck", arena).touched_at_end()


COLUMNS: Mapping[str, Callable[[str], Scene]] = {
    REFERENCE: _reference,
    "epuck": lambda arena: load_scene("epuck", arena),
    "epuck, touches at the end": _end_of_step,
    "epuck_kinematic": lambda arena: load_scene("epuck_kinematic", arena),
}
"""What is compared, and how its scene is made."""

Measured = dict[str, dict[str, dict[str, list[float]]]]
"""By arena, column and controller: mean fitness and share of trials that crashed.

Under EVOLVED, "genomes" are those of the controllers that were evolved here.
"""

EVOLVED = "evolved here"


@dataclass(frozen=True)
class Options:
    """Compare the rungs with a robot on wheels that moves in finer steps.

    Attributes:
        results: folder with studies, whose champions are tried.
        json: file for the figures; figures that it has are not measured again.
        page: page to write; its picture gets the same name, with another ending.
        starts: trials of each controller in the square; a quarter elsewhere.
        threads: threads that step the robots; 0 is one per core.
    """

    results: Path = Path("results")
    json: Path = Path("results/ladder.json")
    page: Path = Path("benchmarks/ladder.md")
    starts: int = 200
    threads: int = 0


def ladder(argv: Sequence[str]) -> int:
    """Run the command line; its exit status."""
    options = parse(Options, "python -m benchmarks.ladder", argv, Options())
    found: Measured = {}
    if options.json.is_file():
        found = json.loads(files.read_text(options.json))
    evolved = found.setdefault(EVOLVED, {}).setdefault("genomes", {})
    controllers = tried(options.results, evolved)
    _save(options.json, found)
    for arena, every in ARENAS.items():
        n = options.starts if every == 1 else options.starts // 4
        starts = held_out_starts(load_scene("epuck", arena), n)
        for name, scene_in in COLUMNS.items():
            column = found.setdefault(arena, {}).setdefault(name, {})
            robots = robots_in(scene_in(arena), n, options.threads)
            for each in controllers[::every]:
                if each.name not in column:
                    trials = run_trials(robots, each.policy(n), starts, each.task)
                    column[each.name] = [
                        round(float(trials.fitness.mean()), 3),
                        round(float(trials.crashed.mean()), 4),
                    ]
                    _save(options.json, found)
            print(f"{arena}: {name}", file=sys.stderr, flush=True)
    # a file may have figures of robots that are gone
    in_arenas = {
        arena: {name: found[arena][name] for name in COLUMNS} for arena in ARENAS
    }
    write_page(options.page, in_arenas, controllers, options.starts)
    return 0


def _save(path: Path, found: Measured) -> None:
    with files.writing():
        files.write_text(path, json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main(ladder)

"""Histories of a study as IOHprofiler's files, which IOHanalyzer opens.

An algorithm's folder holds a JSON file of meta data and a data file, in which each run
begins with a header line. Source: files written by the package `ioh` 0.3.22, and the
readers of `iohinspector` 0.0.8 and of IOHanalyzer.
"""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from epuck_mj.host.files import write_text
from evolution.pages.words import label
from evolution.study.data import StudyData
from evolution.study.finished_run import FinishedRun

FUNCTION_ID, FUNCTION = 1, "WallFollowing"

VERSION = "0.3.22"
"""Version of `ioh` whose format this is; readers tell formats apart by it."""

HEADER = ("evaluations", "raw_y")

LOWEST = 0.0
"""Fitness that every individual has at least: a trial's is a sum of none below 0."""

NOTE = """\
# Histories for IOHanalyzer

One folder per experiment, one run per seed (`instance` is the seed), maximisation of
*stored* fitness; the dimension is the number of genes. Open a folder or a zip of all at
https://iohanalyzer.liacs.nl, or with the Python package `iohinspector`.

- `evaluations` counts individuals. A history has one row per generation, so an
  improvement is written at the end of its generation: late by less than a generation.
- What happened within the first generation is not known. Readers want a row at
  evaluation 1, which says 0: the lowest fitness there is.
- `raw_y` is the best stored fitness so far: what the algorithm goes by. Held-out
  fitness, which the report compares by, has no history.
- `best.x` is empty: the genomes of champions are in `champions.parquet` of the study.
"""


def export_histories(data: StudyData, folder: Path) -> None:
    """Write all runs, and a note on what the numbers are.

    The note is no .txt file: IOHanalyzer would take it for data.

    Raises:
        OSError: if something cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    write_text(folder / "README.md", NOTE)
    for name, runs in data.with_runs.items():
        genes = data.configs[name].topology.n_genes
        path = (
            f"data_f{FUNCTION_ID}_{FUNCTION}/IOHprofiler_f{FUNCTION_ID}_DIM{genes}.dat"
        )
        curves = [improvements(run) for run in runs]
        meta = {
            "version": VERSION,
            "suite": "epuck_mj",
            "function_id": FUNCTION_ID,
            "function_name": FUNCTION,
            "maximization": True,
            "algorithm": {"name": name, "info": label(data, name)},
            "attributes": list(HEADER),
            "scenarios": [
                {
                    "dimension": genes,
                    "path": path,
                    "runs": [
                        _run(run, curve)
                        for run, curve in zip(runs, curves, strict=True)
                    ],
                }
            ],
        }
        place = folder / name
        (place / path).parent.mkdir(parents=True, exist_ok=True)
        write_text(place / path, "".join(map(_text, curves)))
        file = place / f"IOHprofiler_f{FUNCTION_ID}_{FUNCTION}.json"
        write_text(file, json.dumps(meta, indent=1) + "\n")


def improvements(run: FinishedRun) -> list[tuple[int, float]]:
    """Evaluations and best stored fitness so far where it rises, and at the end."""
    spent = run.history["evaluations"]
    best = np.maximum.accumulate(run.history["best"])
    rises = np.diff(best, prepend=LOWEST) > 0
    # readers take the last row for the length of the run
    rises[-1] = True
    curve = [(int(n), float(y)) for n, y in zip(spent[rises], best[rises], strict=True)]
    # readers expect a run to begin at evaluation 1
    return curve if curve[0][0] == 1 else [(1, LOWEST), *curve]


def _run(run: FinishedRun, curve: Sequence[tuple[int, float]]) -> dict:
    """Meta data of a run."""
    best = max(y for _, y in curve)
    first = next(n for n, y in curve if y == best)
    return {
        "instance": run.seed,
        "evals": curve[-1][0],
        "best": {"evals": first, "y": best, "x": []},
    }


def _text(curve: Sequence[tuple[int, float]]) -> str:
    """A run's lines in the data file."""
    lines = [" ".join(HEADER), *(f"{n} {y!r}" for n, y in curve)]
    return "\n".join(lines) + "\n"

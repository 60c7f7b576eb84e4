"""Columns of champions.parquet: what each holds, its name and its type.

A value has a place, such as `("held_out", "epuck", "mean")`. It is stored with the
column, since a robot's name does not come back from a column's.
"""

import json
import math
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import pyarrow as pa

from evolution.judging.scores import Scores

Place = tuple[str, ...]

Row = dict[Place, Any]
"""Values of a run by place; one that is not known is not there."""

TESTS, AS_EVOLVED = "held_out", "held_out_as_evolved"

FIRST: tuple[Place, ...] = (
    ("experiment",),
    ("seed",),
    ("robot",),
    ("stored",),
    ("validation",),
    ("evaluations",),
    ("control_steps",),
    ("provenance",),
    ("genome",),
    ("best_stored", "fitness"),
    ("best_stored", "held_out"),
    ("best_stored", "robot"),
    ("best_stored", "genome"),
    ("tested_on",),
)
"""Columns of every table, in their order; those of tests follow."""

TYPES: Mapping[str, pa.DataType] = {
    "experiment": pa.string(),
    "seed": pa.int64(),
    "robot": pa.string(),
    "evaluations": pa.int64(),
    "control_steps": pa.int64(),
    "provenance": pa.string(),
    "genome": pa.list_(pa.float64()),
    "tested_on": pa.list_(pa.string()),
    "starts": pa.int64(),
}
"""Types by the last part of a place; all others are float64."""

BOUNDS = ("low", "high")

PLACE = b"place"
"""Key of a column's metadata under which its place is stored, as JSON."""


def slug(text: str) -> str:
    """A text in small letters, digits and underscores; empty if it has none."""
    return re.sub("[^a-z0-9]+", "_", text.lower()).strip("_")


def prefixes(robots: Iterable[str]) -> dict[str, str]:
    """Beginning of the column names of each robot, by the robot's name or path."""
    found: dict[str, str] = {}
    for robot in robots:
        name = slug(Path(robot).stem) or "robot"
        found[robot] = name if name not in found.values() else f"{name}_{len(found)}"
    return found


def score_values(scores: Scores) -> Row:
    """What scores say, by place.

    A metric that no trial has is nan, and one that was not measured is not there.
    """
    fields = scores.to_dict()
    found: Row = {
        (key,): fields[key] for key in ("stored", "validation") if key in fields
    }
    for key, value in (fields.get("best_stored") or {}).items():
        found["best_stored", key] = value
    for kind in (TESTS, AS_EVOLVED):
        for robot, test in fields.get(kind, {}).items():
            for key, value in test.items():
                if key == "interval":
                    ends = dict(zip(BOUNDS, value, strict=True))
                    found |= {(kind, robot, key, end): ends[end] for end in BOUNDS}
                elif isinstance(value, Mapping):
                    for name, each in value.items():
                        known = math.nan if each is None else each
                        found[kind, robot, key, name] = known
                else:
                    found[kind, robot, key] = value
    found["tested_on",] = list(fields[TESTS])
    return found


def score_fields(row: Row) -> dict[str, Any]:
    """What `score_values` was made of, as `Scores.to_dict` gives it."""
    fields: dict[str, Any] = {
        key: row[key,] for key in ("stored", "validation") if (key,) in row
    }
    tests: dict[str, dict[str, Any]] = {TESTS: {}, AS_EVOLVED: {}}
    for robot in row["tested_on",]:
        for kind, known in tests.items():
            test = _test(row, kind, robot)
            if test:
                known[robot] = test
    fields[TESTS] = tests[TESTS]
    best = {
        key: row["best_stored", key]
        for key in ("fitness", "held_out", "robot")
        if ("best_stored", key) in row
    }
    if best:
        fields["best_stored"] = best
    if tests[AS_EVOLVED]:
        fields[AS_EVOLVED] = tests[AS_EVOLVED]
    return fields


def _test(row: Row, kind: str, robot: str) -> dict[str, Any]:
    """Fields of a robot's test; empty if there was none."""
    test: dict[str, Any] = {}
    for place, value in row.items():
        if place[:2] != (kind, robot):
            continue
        key, *inside = place[2:]
        if not inside:
            test[key] = value
        elif key == "interval":
            test[key] = [row[*place[:3], end] for end in BOUNDS]
        else:
            test.setdefault(key, {})[inside[0]] = None if math.isnan(value) else value
    return test


def table_of(rows: list[Row]) -> pa.Table:
    """The table of runs, one row each, whose columns depend on nothing but the rows."""
    places = _ordered(dict.fromkeys(place for row in rows for place in row))
    robots = dict.fromkeys(
        place[1] for place in places if place[0] in (TESTS, AS_EVOLVED)
    )
    names = _names(places, prefixes(robots))
    fields = [
        pa.field(
            names[place],
            _type(place),
            metadata={PLACE: json.dumps(place)},
        )
        for place in places
    ]
    arrays = [
        pa.array([row.get(place) for row in rows], field.type)
        for place, field in zip(places, fields, strict=True)
    ]
    return pa.Table.from_arrays(arrays, schema=pa.schema(fields))


def rows_of(table: pa.Table) -> list[Row]:
    """The rows of a table that `table_of` made.

    Raises:
        ValueError: if it is another table.
    """
    columns: dict[Place, list[Any]] = {}
    for field, column in zip(table.schema, table.columns, strict=True):
        stored = (field.metadata or {}).get(PLACE)
        # a column that a user has added
        if stored is not None:
            columns[tuple(json.loads(stored))] = column.to_pylist()
    if not columns:
        raise ValueError("expected columns as evolution.study writes them")
    missing = [place for place in FIRST if place not in columns]
    if missing:
        raise ValueError(f"it has no column {'_'.join(missing[0])}")
    found: list[Row] = [{} for _ in range(table.num_rows)]
    for place, values in columns.items():
        for row, value in zip(found, values, strict=True):
            if value is not None:
                row[place] = value
    return found


def _type(place: Place) -> pa.DataType:
    """The type of a column; metrics and classes of behaviour are numbers."""
    inside = len(place) > 3
    return pa.float64() if inside else TYPES.get([*place][-1], pa.float64())


def _ordered(places: Iterable[Place]) -> list[Place]:
    """The places of a table: first those of every table, then tests by robot."""
    tests = [place for place in places if place not in FIRST]
    robots = list(dict.fromkeys(place[1] for place in tests))
    kinds = (TESTS, AS_EVOLVED)
    tests.sort(key=lambda place: (kinds.index(place[0]), robots.index(place[1])))
    return [*FIRST, *tests]


def _names(places: Iterable[Place], beginnings: Mapping[str, str]) -> dict[Place, str]:
    """Names of columns, each once."""
    found: dict[Place, str] = {}
    for place in places:
        parts = list(place)
        if place[0] in (TESTS, AS_EVOLVED):
            kind = ["as_evolved"] if place[0] == AS_EVOLVED else []
            parts = [beginnings[place[1]], *kind, *map(_word, place[2:])]
        name, number = "_".join(parts), 2
        while name in found.values():
            name, number = f"{'_'.join(parts)}_{number}", number + 1
        found[place] = name
    return found


def _word(part: str) -> str:
    """A part of a place in the name of a column."""
    return {"metrics": "metric"}.get(part) or slug(part) or "value"

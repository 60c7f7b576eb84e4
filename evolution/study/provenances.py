"""provenance.json of a study: each distinct provenance of its runs, once.

Runs share a provenance if whatever may change their results is the same: code,
versions, models and processor. So its id, which the table of champions gives, is the
same for the same study, whatever it is called and however often it was interrupted.
"""

import hashlib
import json
import shlex
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from epuck_mj.host import files
from epuck_mj.host.yaml_and_json import read_json
from evolution.run.provenance import check_provenance
from evolution.settings.file_fields import check_fields

THREADS, COMMANDS = "threads", "commands"
"""What may differ between runs of one provenance: lists of all that were used.

A command is the text of a run's `argv`.
"""

OWN = ("started", "finished", "resumed", "argv", THREADS)
"""What belongs to a run alone."""


def provenance_of(fields: Mapping[str, Any]) -> dict[str, Any]:
    """The provenance of a run as an entry of provenance.json.

    Args:
        fields: as `RunDirectory.provenance_fields` gives them.
    """
    parts = [fields, *fields.get("resumed", ())]
    first, *others = map(_shared, parts)
    entry = dict(first)
    # resumptions with another code, version or processor
    differing: list[dict[str, Any]] = []
    for part in others:
        if part != first and part not in differing:
            differing.append(part)
    if differing:
        entry["resumed"] = differing
    text = json.dumps(entry, sort_keys=True)
    name = hashlib.sha256(text.encode()).hexdigest()[:12]
    threads = {part.get(THREADS) for part in parts}
    commands = {shlex.join(part["argv"]) for part in parts if part.get("argv")}
    return {
        "id": name,
        **entry,
        COMMANDS: sorted(commands),
        THREADS: sorted(threads - {None}),
        "started": fields.get("started"),
        "finished": fields.get("finished"),
    }


def _shared(fields: Mapping[str, Any]) -> dict[str, Any]:
    """What runs of one provenance have in common."""
    return {key: value for key, value in fields.items() if key not in OWN}


def together(entries: Iterable[Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """Entries by id; of equal ones, the first start and the last finish."""
    found: dict[str, dict[str, Any]] = {}
    for entry in entries:
        known = found.setdefault(entry["id"], dict(entry))
        for key in (COMMANDS, THREADS):
            known[key] = sorted({*known[key], *entry[key]})
        for key, choose in (("started", min), ("finished", max)):
            times = [each[key] for each in (known, entry) if each.get(key)]
            known[key] = choose(times, default=None)
    return found


def write_provenances(
    path: Path, entries: Mapping[str, Mapping[str, Any]], of_runs: Iterable[str]
) -> None:
    """Write the provenances of runs, in the order of the runs.

    Args:
        path: of the file.
        entries: by id.
        of_runs: ids of the provenances of all runs.
    """
    counts = Counter(of_runs)
    listed = [{**entries[name], "runs": n} for name, n in counts.items()]
    files.write_text(path, json.dumps({"provenances": listed}, indent=1) + "\n")


def read_provenances(path: Path) -> dict[str, dict[str, Any]]:
    """What `write_provenances` wrote, by id; empty if there is no file.

    Raises:
        UserError: if it is damaged.
    """
    if not files.is_file(path):
        return {}
    fields = read_json(path)
    check_fields(_Provenances, fields, path)
    for entry in fields["provenances"]:
        check_provenance(entry, path)
    return {entry["id"]: entry for entry in fields["provenances"]}


class _Entry(BaseModel, frozen=True, strict=True):
    """What an entry says besides what is in the provenance of a run."""

    id: str
    runs: int
    commands: list[str]
    threads: list[int]


class _Provenances(BaseModel, frozen=True, strict=True):
    """What provenance.json of a study says."""

    provenances: list[_Entry]

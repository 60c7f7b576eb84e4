"""Provenance of a run: versions, code, models, machine, command and time."""

import json
import platform
import subprocess
import sys
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import BaseModel

from epuck_mj.host.yaml_and_json import read_json
from evolution.settings.file_fields import check_fields

if TYPE_CHECKING:
    from epuck_mj.scene.model import Scene

PACKAGES = (
    "mujoco",
    "dm-control",
    "numpy",
    "numba",
    "llvmlite",
    "scipy",
    "cmaes",
    "pydantic",
    "rerun-sdk",
)


def provenance(
    scene: "Scene",
    own_parts: Mapping[str, str],
    argv: Sequence[str],
    engine: str,
    threads: int,
) -> dict[str, Any]:
    """Everything that could explain a difference, as JSON values.

    MuJoCo's results are bit-identical for one version on one type of processor only,
    hence the processor's flags.
    """
    return {
        "argv": list(argv),
        "engine": engine,
        "threads": threads,
        "versions": {
            "python": platform.python_version(),
            **_versions(),
            "blas": blas(),
        },
        "git": _git(),
        "mjcf_sha256": dict(scene.sha256),
        "own_sha256": dict(own_parts),
        "platform": " ".join([platform.system(), *platform.libc_ver()]),
        "processor": processor(),
        "started": now(),
        "finished": None,
    }


@cache
def _versions() -> Mapping[str, str]:
    """Versions of the packages that decide on results."""
    return {package: version(package) for package in PACKAGES}


@cache
def blas() -> str:
    """Name and version of numpy's linear algebra, on which CMA-ES depends."""
    blas = np.show_config(mode="dicts")["Build Dependencies"]["blas"]
    return f"{blas['name']} {blas['version']}"


class _Git(BaseModel, frozen=True, strict=True):
    commit: str
    modified: bool


class _Processor(BaseModel, frozen=True, strict=True):
    model: str | None = None
    flags: list[str] = []


class _Provenance(BaseModel, frozen=True, strict=True):
    """What a provenance file says, if it says it."""

    argv: list[str] = []
    commands: list[str] = []
    versions: dict[str, str] = {}
    git: _Git | None = None
    mjcf_sha256: dict[str, str] = {}
    own_sha256: dict[str, str] = {}
    threads: int | list[int] | None = None
    processor: _Processor = _Processor()
    started: str | None = None
    finished: str | None = None
    resumed: list["_Provenance"] = []


def read_provenance(path: Path) -> dict[str, Any]:
    """What `provenance` gave, from a file; older files say less.

    Raises:
        UserError: if it cannot be read, or a value is something else.
    """
    fields = read_json(path)
    check_provenance(fields, path)
    return fields


def check_provenance(fields: Mapping[str, Any], path: Path) -> None:
    """Refuse what is no provenance.

    Args:
        fields: what a file says.
        path: of the file.

    Raises:
        UserError: if a value is something else.
    """
    check_fields(_Provenance, fields, path)


def now() -> str:
    """The time in UTC, ISO 8601."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def to_json(fields: Mapping[str, Any]) -> str:
    """Text of the provenance file."""
    return json.dumps(fields, indent=1) + "\n"


@cache
def _git() -> dict[str, Any] | None:
    """Commit and whether the work tree differs from it; None outside a checkout.

    Asked for once in a process, whose code does not change either.
    """
    folder = Path(__file__).resolve().parent
    try:
        commit, status = (
            subprocess.run(
                ["git", *arguments],
                cwd=folder,
                capture_output=True,
                text=True,
                check=True,
                timeout=10,
            ).stdout.strip()
            for arguments in (("rev-parse", "HEAD"), ("status", "--porcelain"))
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return {"commit": commit, "modified": bool(status)}


@cache
def processor() -> dict[str, Any]:
    """Model name and flags, as far as the system tells."""
    fields: dict[str, Any] = {"machine": platform.machine(), "model": None, "flags": []}
    if sys.platform == "linux":
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            key, _, value = line.partition(":")
            if key.strip() == "model name":
                fields["model"] = value.strip()
            elif key.strip() in ("flags", "Features"):
                fields["flags"] = value.split()
                break
    return fields

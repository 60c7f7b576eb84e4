"""Controller files: a controller with its task, its origin and its scores, as JSON."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Self

import numpy as np

from epuck_mj.errors import UserError
from epuck_mj.host.files import is_directory, is_file
from epuck_mj.host.limits import check, shown
from epuck_mj.host.yaml_and_json import read_json
from epuck_mj.policies.topology import Topology, topology_from
from epuck_mj.step.control import BatchPolicy, TaskParameters

FORMAT = "epuck_mj.controller/1"

CHAMPION = "champion.json"
"""Controller file in the directory of a finished run."""

CHAMPIONS = "champions.parquet"
"""Table of champions in the directory of a study, which only `evolution` reads."""


@dataclass(frozen=True)
class Origin:
    """Where a controller was evolved.

    Attributes:
        robot: name of a shipped robot, or path of its MJCF.
        arena: name of a shipped arena, or path of its MJCF.
        start_clearance: least distance from the shell to a wall at a start [m]; None
            if the file does not say.
        mjcf_sha256: of each file compiled: `arena`, `robot`, and all others by name.
        own_sha256: of the file of each own part, by the part's name.
    """

    robot: str
    arena: str
    start_clearance: float | None = None
    mjcf_sha256: dict[str, str] = field(default_factory=dict)
    own_sha256: dict[str, str] = field(default_factory=dict)

    @classmethod
    def from_dict(cls, fields: Mapping[str, Any]) -> Self:
        """Read what `dataclasses.asdict` gave; ignore other keys.

        Raises:
            ValueError: if it is anything else.
        """
        for key in ("robot", "arena"):
            if not isinstance(fields.get(key), str):
                raise ValueError(f"it does not say which {key} it is for")
        clearance = fields.get("start_clearance")
        if clearance is not None:
            check("start_clearance", clearance)
        hashes = {key: fields.get(key, {}) for key in ("mjcf_sha256", "own_sha256")}
        for key, value in hashes.items():
            if not isinstance(value, dict):
                raise ValueError(f"expected an object as {key}, got {shown(value)}")
            if not all(isinstance(each, str) for each in value.values()):
                raise ValueError(f"expected texts in {key}, got {shown(value)}")
        return cls(fields["robot"], fields["arena"], clearance, **hashes)


@dataclass(frozen=True)
class ControllerFile:
    """A controller with all that is needed to use it.

    Attributes:
        network: what its genome decodes to.
        genome: its weights, `(genes,)`.
        task: what its trials were.
        origin: where it was evolved; `scene` in the JSON.
        scores: what is known of its worth, as the file says it.
    """

    network: Topology
    genome: np.ndarray
    task: TaskParameters
    origin: Origin
    scores: dict[str, Any]

    @property
    def controller(self) -> BatchPolicy:
        """The controller, ready to be called."""
        return self.network.decode(self.genome)

    def to_json(self) -> str:
        """The file's text; the genome comes back bit for bit."""
        # unknown values are left out
        origin = {k: v for k, v in asdict(self.origin).items() if v is not None}
        if not self.origin.own_sha256:
            del origin["own_sha256"]
        fields = {
            "format": FORMAT,
            "network": self.network.to_dict(),
            "task": asdict(self.task),
            "scene": origin,
            "scores": self.scores,
            "genome": [float(gene) for gene in self.genome],
        }
        return json.dumps(fields, indent=1) + "\n"

    @classmethod
    def from_dict(cls, fields: Mapping[str, Any]) -> Self:
        """Read what `to_json` wrote.

        Raises:
            ValueError: if it is anything else.
        """
        if fields.get("format") != FORMAT:
            raise ValueError(f"expected format '{FORMAT}'")
        for name in ("network", "task", "scene", "scores"):
            if not isinstance(fields.get(name), dict):
                raise ValueError(f"expected an object as {name}")
        network = topology_from(fields["network"])
        genome = fields.get("genome")
        if not isinstance(genome, list):
            raise ValueError(f"expected a list as genome, got {shown(genome)}")
        if len(genome) != network.n_genes:
            raise ValueError(f"expected {network.n_genes} genes, got {len(genome)}")
        for gene in genome:
            check("gene", gene)
        task = TaskParameters.from_dict(fields["task"])
        origin = Origin.from_dict(fields["scene"])
        return cls(network, np.array(genome, float), task, origin, fields["scores"])


def champion_file(path: Path) -> Path:
    """The controller file at a path: of the directory of a run, its champion's.

    Raises:
        UserError: if the run has no champion yet, or is in the tables of a study.
    """
    if not is_directory(path):
        if not path.exists() and is_file(path.parent.parent / CHAMPIONS):
            raise UserError(
                f"no file '{path}': runs of that study are rows of a table; expected a "
                f"file, as python -m evolution.export {path} champion.json writes it"
            )
        return path
    if not is_file(path / CHAMPION):
        raise UserError(f"no champion in '{path}': its run is not finished")
    return path / CHAMPION


def load_controller(path: str | Path) -> ControllerFile:
    """The controller stored at `path`, a file or the directory of a finished run.

    Raises:
        UserError: if there is none, or it is not a controller file.
    """
    path = champion_file(Path(path))
    fields = read_json(path)
    try:
        return ControllerFile.from_dict(fields)
    except (ValueError, TypeError) as error:
        raise UserError(f"'{path}' is not a controller file: {error}") from None

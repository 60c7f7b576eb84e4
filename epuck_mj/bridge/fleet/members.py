"""Members of a fleet: name, port, controller and calibration of each robot."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from epuck_mj.errors import UserError
from epuck_mj.host.limits import shown
from epuck_mj.host.yaml_and_json import read_yaml

ROBOTS_MAX = 40
"""Most robots of a fleet: each has a process. Chosen."""

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,19}")
"""Names of robots, which are names of files as well."""

KEYS = ("port", "controller", "calibration")
"""Keys of a robot in the file of a fleet; only the last one may be missing."""


@dataclass(frozen=True)
class Member:
    """A robot of a fleet.

    Attributes:
        name: of the robot, and of its log.
        port: where it is reached.
        controller: directory of a finished run, controller file, or wall-follower.
        calibration: file of its calibration; None for the nominal robot.
    """

    name: str
    port: str
    controller: str
    calibration: str | None = None


def members_at(ports: Sequence[str], controller: str) -> tuple[Member, ...]:
    """Robots at these ports, all with the same controller.

    Raises:
        UserError: if that is no fleet.
    """
    return _checked(
        [Member(f"robot-{n}", port, controller) for n, port in enumerate(ports, 1)],
        "--port",
    )


def read_fleet(path: Path) -> tuple[Member, ...]:
    """The robots of a file: a mapping from names to their keys.

    Raises:
        UserError: if it is anything else.
    """
    members = []
    for name, fields in read_yaml(path).items():
        where = f"'{path}': robot {shown(name)}"
        if not isinstance(name, str) or not NAME.fullmatch(name):
            raise UserError(
                f"{where}: expected a name of at most 20 letters, digits, - and _"
            )
        members.append(_member(name, fields, where))
    return _checked(members, f"'{path}'")


def _member(name: str, fields: Any, where: str) -> Member:
    if not isinstance(fields, dict):
        raise UserError(
            f"{where}: expected the keys {', '.join(KEYS)}, got {shown(fields)}"
        )
    if unknown := [str(key) for key in fields if key not in KEYS]:
        raise UserError(
            f"{where}: unknown {shown(', '.join(unknown))}; available: "
            f"{', '.join(KEYS)}"
        )
    for key in KEYS[:2]:
        if key not in fields:
            raise UserError(f"{where}: expected a {key}, got none")
    for key, value in fields.items():
        if not isinstance(value, str) or not value:
            raise UserError(f"{where}: expected a text as {key}, got {shown(value)}")
    return Member(name, **fields)


def _checked(members: list[Member], where: str) -> tuple[Member, ...]:
    """The members, if their number and ports make sense."""
    if not 1 <= len(members) <= ROBOTS_MAX:
        raise UserError(
            f"{where}: expected from 1 to {ROBOTS_MAX} robots, got {len(members)}"
        )
    names: dict[str, str] = {}
    for member in members:
        # names become file names, and some file systems ignore case
        for key, what in ((member.port, "port"), (member.name.lower(), "name")):
            other = names.setdefault(f"{what} {key}", member.name)
            if other is not member.name:
                raise UserError(
                    f"{where}: robots {other} and {member.name} have the same {what}"
                )
    return tuple(members)

"""Types of the keys of a configuration that are more than numbers."""

from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field
from tyro.constructors import PrimitiveConstructorSpec

from epuck_mj.errors import UserError
from epuck_mj.host.command_line import word
from epuck_mj.host.own_parts import is_own
from epuck_mj.step.calibration import Calibration
from epuck_mj.step.fitness import FORMULAS
from evolution.search.table import ALGORITHMS, OptimizerParameters

N_VALIDATION = 200
"""Default number of starts on which a champion is chosen."""

N_TEST = 1000
"""Default number of starts on which a champion is tested."""

STARTS_MAX = 100_000
"""Most starts on which a champion is chosen, and on which it is tested."""

FEEDFORWARD = "feedforward"
"""Name of the paper's network, with the configuration's hidden neurons and biases."""


def _one_of(*shipped: str) -> AfterValidator:
    """Validator of names: shipped ones, or those of own parts."""

    def known(name: str) -> str:
        if name in shipped or is_own(name):
            return name
        raise ValueError(f"expected {', '.join(shipped)} or my.py:name")

    return AfterValidator(known)


FitnessName = Annotated[str, _one_of(*FORMULAS), word("FITNESS")]

NetworkName = Annotated[str, _one_of(FEEDFORWARD), word("NETWORK")]


def _of_known_algorithm(value: Any) -> Any:
    """The parameters `value`, if they name a shipped algorithm.

    Raises:
        ValueError: if they name none, or an unknown one.
    """
    if isinstance(value, dict):
        algorithm = value.get("algorithm")
    else:
        algorithm = getattr(value, "algorithm", None)
    # a list, which `in` cannot look up in a mapping, is no algorithm either
    if algorithm not in list(ALGORITHMS):
        raise ValueError(
            f"expected a mapping with 'algorithm', one of {', '.join(ALGORITHMS)}, or "
            "my.py:Class"
        )
    return value


OptimizerConfig = Annotated[
    OptimizerParameters,
    Field(discriminator="algorithm"),
    BeforeValidator(_of_known_algorithm),
]


def _calibration(value: Any) -> Any:
    """Calibration from keys in the config, or from a file, whose keys are kept.

    Raises:
        ValueError: if keys or file are no calibration.
    """
    if value is None or isinstance(value, Calibration):
        return value
    if not isinstance(value, str):
        return Calibration.from_dict(value)
    try:
        return Calibration.load(Path(value))
    except UserError as error:
        raise ValueError(str(error)) from None


def _calibration_flag(value: str) -> Calibration | None:
    """Calibration in the file that a flag names; None (nominal robot) for `none`."""
    return None if value == "none" else Calibration.load(Path(value))


CalibrationConfig = Annotated[
    Calibration | None,
    BeforeValidator(_calibration),
    # a flag takes the file only
    PrimitiveConstructorSpec(
        nargs=1,
        metavar="FILE",
        instance_from_str=lambda words: _calibration_flag(words[0]),
        is_instance=lambda value: value is None or isinstance(value, Calibration),
        str_from_instance=lambda value: ["none" if value is None else "as stored"],
    ),
]

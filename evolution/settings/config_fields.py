"""Types of the keys of a configuration that are more than numbers."""

from collections.abc import Sequence
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Annotated, Any, get_args, get_type_hints

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    TypeAdapter,
    ValidationError,
)
from pydantic_core import InitErrorDetails, PydanticCustomError
from tyro.constructors import PrimitiveConstructorSpec

from epuck_mj.errors import UserError
from epuck_mj.host.command_line import word
from epuck_mj.host.limits import LIMITS, shown
from epuck_mj.host.own_parts import is_own
from epuck_mj.policies.topology import NETWORKS
from epuck_mj.step.calibration import Calibration
from epuck_mj.step.fitness import FORMULAS
from evolution.search.table import ALGORITHMS, OptimizerParameters
from evolution.settings.config_errors import COMPLETE, one_line

N_VALIDATION = 200
"""Default number of starts on which a champion is chosen."""

N_TEST = 1000
"""Default number of starts on which a champion is tested."""


def within(name: str) -> BeforeValidator:
    """Validator of numbers within the limit of that name."""
    limit = LIMITS[name]

    def check(value: Any) -> Any:
        if limit.allows(value):
            return value
        raise ValueError(limit.expected)

    return BeforeValidator(check)


def _one_of(*shipped: str) -> AfterValidator:
    """Validator of names: shipped ones, or those of own parts."""

    def known(name: str) -> str:
        if name in shipped or is_own(name):
            return name
        raise ValueError(f"expected {', '.join(shipped)} or my.py:name")

    return AfterValidator(known)


FitnessName = Annotated[str, _one_of(*FORMULAS), word("FITNESS")]

NetworkName = Annotated[str, _one_of(*NETWORKS), word("NETWORK")]


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
    kind = ALGORITHMS[algorithm]
    return _checked_types(kind, _with_parts(kind, value))


def _with_parts(kind: type, value: Any) -> Any:
    """Parameters of that kind, with those of its parts as objects.

    Raises:
        ValueError: naming a part that is not as expected.
    """
    if not isinstance(value, dict):
        return value
    made = dict(value)
    for key, hint in get_type_hints(kind).items():
        kinds = [each for each in get_args(hint) or (hint,) if is_dataclass(each)]
        if kinds and isinstance(value.get(key), dict):
            made[key] = _part(key, value[key], kinds)
    return made


def _part(key: str, value: dict, kinds: Sequence[Any]) -> Any:
    """Parameters of an optimiser that is a part of another, of one of these kinds."""
    by_name = {kind.algorithm: kind for kind in kinds}
    algorithm = value.get("algorithm")
    if algorithm not in list(by_name):
        raise ValueError(
            f"{key}: expected a mapping with 'algorithm', one of {', '.join(by_name)}, "
            f"got {shown(algorithm)}"
        )
    kind = by_name[algorithm]
    try:
        return TypeAdapter(kind).validate_python(_checked_types(kind, value))
    except ValidationError as error:
        names = [each.name for each in fields(kind)]
        line = {"line": f"{key}: {one_line(error, names, kind)}"}
        raise PydanticCustomError(COMPLETE, "{line}", line) from None


KINDS = {int: "a whole number", float: "a number", bool: "true or false"}
"""Types whose values pydantic would make of texts and of one another."""


def _checked_types(kind: type, value: Any) -> Any:
    """Parameters of that kind, if numbers are numbers and booleans are booleans.

    Raises:
        ValidationError: naming those that are not.
    """
    # anything but a mapping is refused for that
    given = value if isinstance(value, dict) else {}
    errors = [
        InitErrorDetails(
            type=PydanticCustomError("kind", "expected {kind}", {"kind": KINDS[hint]}),
            loc=(key,),
            input=given[key],
        )
        for key, hint in get_type_hints(kind).items()
        if hint in KINDS and key in given and not _is(given[key], hint)
    ]
    if errors:
        raise ValidationError.from_exception_data(kind.__name__, errors)
    return value


def _is(value: Any, kind: type) -> bool:
    """Whether a value may stand for that kind; 10.0 is a whole number as well."""
    if kind is bool or isinstance(value, bool):
        return type(value) is kind
    return isinstance(value, int | float)


def strictly_typed(kind: type) -> BeforeValidator:
    """Validator of the parameters of a user's optimiser by their types."""
    return BeforeValidator(lambda value: _checked_types(kind, value))


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

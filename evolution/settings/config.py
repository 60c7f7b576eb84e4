"""What an experiment is: typed, frozen, read from YAML, unknown keys refused."""

from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    StrictBool,
    StrictFloat,
    StrictInt,
    ValidationError,
    model_validator,
)
from tyro.constructors import PrimitiveConstructorSpec

from epuck_mj.constants import PROXIMITY_RANGE, SPEED_MAX, TURN_RATE_MAX
from epuck_mj.errors import UserError
from epuck_mj.host.yaml_and_json import parse_yaml, to_yaml
from epuck_mj.policies.network import Network
from epuck_mj.scene.model_files import absolute
from epuck_mj.step.calibration import Calibration
from epuck_mj.step.conditions import Conditions, NoiseLevel
from epuck_mj.step.control import START_CLEARANCE, STEPS_MAX, TaskParameters
from epuck_mj.step.motors import Speeds
from evolution.judging.held_out_starts import N_TEST, N_VALIDATION, STARTS_MAX
from evolution.search.table import ALGORITHMS, OptimizerParameters, SearchSpace
from evolution.settings.setting import Setting


def _of_known_algorithm(value: Any) -> Any:
    """`value`, which says whose parameters it holds.

    Raises:
        ValueError: if it does not.
    """
    if isinstance(value, dict):
        algorithm = value.get("algorithm")
    else:
        algorithm = getattr(value, "algorithm", None)
    # a list, which `in` cannot look up in a mapping, is no algorithm either
    if algorithm not in list(ALGORITHMS):
        raise ValueError(
            f"expected a mapping with 'algorithm', one of {', '.join(ALGORITHMS)}"
        )
    return value


OptimizerConfig = Annotated[
    OptimizerParameters,
    Field(discriminator="algorithm"),
    BeforeValidator(_of_known_algorithm),
]


def _calibration(value: Any) -> Any:
    """A calibration in the config itself, which is how one of a file is kept.

    Raises:
        ValueError: if it is none.
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
    """The file that a flag names; `none` is the robot of the books."""
    return None if value == "none" else Calibration.load(Path(value))


CalibrationConfig = Annotated[
    Calibration | None,
    BeforeValidator(_calibration),
    # a flag takes the file only
    PrimitiveConstructorSpec(
        nargs=1,
        metavar="PATH",
        instance_from_str=lambda words: _calibration_flag(words[0]),
        is_instance=lambda value: value is None or isinstance(value, Calibration),
        str_from_instance=lambda value: ["none" if value is None else "as stored"],
    ),
]


class ExperimentConfig(BaseModel):
    """One run of evolution, but for how it is carried out (threads, engine, output)."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    seed: StrictInt = Field(1, ge=0, description="seed of everything random")
    evaluations: StrictInt = Field(
        30_000, ge=1, description="budget: individuals evaluated, whole generations"
    )
    robot: str = Field(
        "epuck_planar", description="epuck_planar, epuck (wheels) or an MJCF file"
    )
    arena: str = Field("arena", description="name of a shipped arena or an MJCF file")
    trials: StrictInt = Field(5, ge=1, description="trials of an individual")
    steps: StrictInt = Field(
        300, ge=1, le=STEPS_MAX, description="control steps of a trial"
    )
    control_step: StrictFloat = Field(0.1, gt=0, description="control step [s]")
    fitness: Literal["product", "literal"] = Field(
        "product", description="step fitness: the paper's prose or its equation (2)"
    )
    v_max: StrictFloat = Field(
        SPEED_MAX, gt=0, description="forward speed at v = 1 [m/s]"
    )
    w_max: StrictFloat = Field(
        TURN_RATE_MAX, gt=0, description="yaw rate at w = 1 [rad/s]"
    )
    sensor_range: StrictFloat = Field(
        PROXIMITY_RANGE, gt=0, description="range of the proximity sensors [m]"
    )
    noise: NoiseLevel = Field(
        "none", description="none: ideal sensors and motors; others: as real ones"
    )
    randomise: StrictBool = Field(
        False, description="another robot in each trial; needs noise"
    )
    calibration: CalibrationConfig = Field(
        None,
        description="file of python -m epuck_mj.calibrate, or its keys: that robot "
        "in all trials; needs noise",
    )
    start_clearance: StrictFloat = Field(
        START_CLEARANCE,
        gt=0,
        le=1,
        description="least distance to a wall at a start [m]",
    )
    hidden: StrictInt = Field(4, ge=1, description="hidden neurons")
    biases: StrictBool = Field(
        False, description="give hidden and output neurons a bias"
    )
    weight_bound: StrictFloat = Field(
        5.0, gt=0, le=1e6, description="weights stay within +- this"
    )
    weight_init: StrictFloat = Field(
        5.0, gt=0, le=1e6, description="first weights are uniform within +- this"
    )
    validation_starts: StrictInt = Field(
        N_VALIDATION,
        ge=1,
        le=STARTS_MAX,
        description="fresh starts on which the champion is chosen",
    )
    test_starts: StrictInt = Field(
        N_TEST,
        ge=2,
        le=STARTS_MAX,
        description="other fresh starts on which the champion is tested",
    )
    optimizer: OptimizerConfig

    @model_validator(mode="after")
    def _of_robots_there_are(self) -> Self:
        """Refuse conditions that exclude themselves."""
        _ = self.conditions
        return self

    @property
    def conditions(self) -> Conditions:
        """What the robots are like."""
        return Conditions(self.noise, self.randomise, self.calibration)

    @property
    def task(self) -> TaskParameters:
        """What a trial is."""
        return TaskParameters(
            steps=self.steps,
            control_step=self.control_step,
            fitness=self.fitness,
            sensor_range=self.sensor_range,
            speeds=Speeds(self.v_max, self.w_max),
        )

    @property
    def budget(self) -> int:
        """Trials that evolution may cost."""
        return self.evaluations * self.trials

    @property
    def setting(self) -> Setting:
        """In what the trials are lived."""
        return Setting(self.arena, self.task, self.start_clearance)

    @property
    def network(self) -> Network:
        """Shape of the controllers."""
        return Network(self.hidden, self.biases)

    @property
    def search_space(self) -> SearchSpace:
        """Where genomes may be."""
        return SearchSpace(
            genes=self.network.n_genes,
            lower=-self.weight_bound,
            upper=self.weight_bound,
            init_lower=-self.weight_init,
            init_upper=self.weight_init,
        )

    def located(self) -> Self:
        """The config with paths that mean the same from anywhere."""
        paths = {"robot": absolute(self.robot), "arena": absolute(self.arena)}
        return self.model_copy(update=paths)

    def to_yaml(self) -> str:
        """The resolved config: every key, in the order above."""
        return to_yaml(self.model_dump())

    @classmethod
    def from_yaml(cls, text: str, where: str) -> Self:
        """The config that `to_yaml` wrote; keys it did not know have their defaults.

        Raises:
            UserError: beginning with `where`, if it is anything else.
        """
        return cls.parsed(parse_yaml(text, where), where)

    @classmethod
    def parsed(cls, fields: Any, where: str) -> Self:
        """The config that keys and values make.

        Raises:
            UserError: beginning with `where`, if they make none.
        """
        try:
            return cls.model_validate(fields)
        except ValidationError as error:
            raise UserError(f"{where}: {one_line(error)}") from None


def differing_keys(stored: ExperimentConfig, asked: ExperimentConfig) -> list[str]:
    """What two configs disagree about, a text for each key."""
    return [
        f"{key} (stored {values.get('stored')}, got {values.get('asked')})"
        for key, values in differences({"stored": stored, "asked": asked}).items()
    ]


def differences(
    configs: Mapping[str, ExperimentConfig], without: Sequence[str] = ()
) -> dict[str, dict[str, Any]]:
    """Keys in which configs differ, and the value of each config that has the key.

    Args:
        configs: by name.
        without: keys that may differ.
    """
    each = {name: flat(config) for name, config in configs.items()}
    keys = dict.fromkeys(key for fields in each.values() for key in fields)
    found = {
        key: {name: fields[key] for name, fields in each.items() if key in fields}
        for key in keys
        if key not in without
    }
    return {
        key: values
        for key, values in found.items()
        if len(values) < len(each) or len(set(map(repr, values.values()))) > 1
    }


def flat(config: ExperimentConfig) -> dict[str, Any]:
    """Keys and values, the optimiser's as `optimizer.<key>`."""
    fields = config.model_dump()
    optimizer = fields.pop("optimizer")
    return fields | {f"optimizer.{key}": value for key, value in optimizer.items()}


def one_line(error: ValidationError) -> str:
    """Everything a config got wrong, with the keys there are when one is unknown."""
    parts = []
    for detail in error.errors():
        key = ".".join(str(part) for part in detail["loc"] if part not in ALGORITHMS)
        if detail["type"] in ("extra_forbidden", "unexpected_keyword_argument"):
            available = ", ".join(_keys(detail["loc"]))
            parts.append(f"unknown key '{key}'; available: {available}")
        elif detail["type"] == "missing":
            parts.append(f"key '{key}' is missing")
        elif not detail["loc"]:
            # of several keys together
            parts.append(detail["msg"].removeprefix("Value error, "))
        else:
            message = detail["msg"].removeprefix("Value error, ")
            parts.append(f"{key}: {message}, got {_shown(detail['input'])}")
    return "; ".join(parts)


def _keys(loc: tuple[int | str, ...]) -> list[str]:
    """The keys that could stand where the unknown key at `loc` stands."""
    if len(loc) == 1:
        return list(ExperimentConfig.model_fields)
    return [field.name for field in fields(ALGORITHMS[str(loc[1])])]


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) < 60 else f"{text[:57]}..."

"""Configuration of an experiment: typed, frozen, read from YAML."""

from functools import cache
from typing import Annotated, Any, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    StrictBool,
    ValidationError,
    create_model,
    model_validator,
)

from epuck_mj.constants import PROXIMITY_RANGE, SPEED_MAX, TURN_RATE_MAX
from epuck_mj.errors import UserError
from epuck_mj.host.command_line import word
from epuck_mj.host.limits import shown
from epuck_mj.host.own_parts import is_own, located, own_part
from epuck_mj.host.yaml_and_json import parse_yaml, to_yaml
from epuck_mj.policies.topology import FEEDFORWARD, NETWORKS, OwnNetwork, Topology
from epuck_mj.scene.model_files import KINEMATIC_ROBOT, absolute, is_kinematic
from epuck_mj.step.conditions import Conditions, NoiseLevel
from epuck_mj.step.control import START_CLEARANCE, TaskParameters
from evolution.search.table import SearchSpace, own_parameters
from evolution.settings.config_errors import one_line
from evolution.settings.config_fields import (
    N_TEST,
    N_VALIDATION,
    CalibrationConfig,
    FitnessName,
    NetworkName,
    OptimizerConfig,
    strictly_typed,
    within,
)
from evolution.settings.setting import Setting


class ExperimentConfig(BaseModel):
    """Configuration of one run of evolution, without threads, engine and output."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    seed: Annotated[int, within("seed")] = Field(
        1, description="seed of everything random"
    )
    evaluations: Annotated[int, within("evaluations")] = Field(
        30_000,
        description="number of individuals to evaluate, rounded down to whole "
        "generations",
    )
    robot: Annotated[str, word("ROBOT")] = Field(
        KINEMATIC_ROBOT,
        description="epuck_kinematic (the robot on wheels without physics: hundreds "
        "of times faster), epuck (on wheels in MuJoCo), epuck_cone_kinematic or "
        "epuck_cone (the same two with sensors that see cones) or the path of an MJCF "
        "file",
    )
    climb: Annotated[float, within("climb")] = Field(
        0.9,
        description="share of the evaluations that are spent on a kinematic robot; the "
        "rest is spent on the same robot on wheels, where the population is evaluated "
        "again, unless the rest is too small for that; 1: all are spent on the "
        "kinematic robot; without effect on other robots",
    )
    arena: Annotated[str, word("ARENA")] = Field(
        "arena", description="name of a shipped arena or the path of an MJCF file"
    )
    trials: Annotated[int, within("trials")] = Field(
        5, description="trials per individual"
    )
    starts_every: Annotated[int, within("starts_every")] = Field(
        1, description="number of generations after which trials get new starts"
    )
    own_starts: StrictBool = Field(
        False,
        description="give each individual starts of its own; otherwise all individuals "
        "of a generation have the same starts",
    )
    steps: Annotated[int, within("steps")] = Field(
        300, description="control steps per trial"
    )
    control_step: Annotated[float, within("control_step")] = Field(
        0.1, description="duration of a control step [s]"
    )
    fitness: FitnessName = Field(
        "product",
        description="step fitness: product (as the paper describes it), literal (the "
        "paper's equation 2), spaced (as product, but it pays most for a distance of 8 "
        "to 15 mm) or my.py:name (a function of your own)",
    )
    v_max: Annotated[float, within("v_max")] = Field(
        SPEED_MAX, description="forward speed at v = 1 [m/s]"
    )
    w_max: Annotated[float, within("w_max")] = Field(
        TURN_RATE_MAX, description="yaw rate at w = 1 [rad/s]"
    )
    sensor_range: Annotated[float, within("sensor_range")] = Field(
        PROXIMITY_RANGE, description="range of the proximity sensors [m]"
    )
    noise: NoiseLevel = Field(
        "none",
        description="sensors and motors: none (ideal), calibrated (with the noise of "
        "real ones) or strong (with more noise)",
    )
    randomise: StrictBool = Field(
        False, description="give each trial a different robot; needs noise"
    )
    randomise_all: StrictBool = Field(
        False,
        description="give each trial a robot that differs in all that real ones differ "
        "in: as randomise, and in the body's radius, the place of the sensors, light, "
        "battery and a slipping start; needs noise",
    )
    calibration: CalibrationConfig = Field(
        None,
        description="file written by python -m epuck_mj.calibrate, or its keys: use "
        "that robot in all trials; needs noise",
    )
    start_clearance: Annotated[float, within("start_clearance")] = Field(
        START_CLEARANCE, description="least distance to a wall at a start [m]"
    )
    body_margin: Annotated[float, within("body_margin")] = Field(
        0.0,
        description="evolve robots whose body is wider by this margin on every side "
        "[m], so that champions keep away from walls; champions are chosen with the "
        "margin and tested without it",
    )
    network: NetworkName = Field(
        FEEDFORWARD,
        description="feedforward (the paper's, with the hidden neurons and biases "
        "below), feedforward_changes (which also sees how each reading has changed "
        "since the last control step), follower (a wall follower by rule, of 13 "
        "numbers) or my.py:Class (a network of your own)",
    )
    hidden: Annotated[int, within("hidden")] = Field(
        4, description="number of hidden neurons"
    )
    biases: StrictBool = Field(
        False, description="give hidden and output neurons a bias"
    )
    weight_bound: Annotated[float, within("weight_bound")] = Field(
        5.0, description="weights stay within plus or minus this value"
    )
    weight_init: Annotated[float, within("weight_init")] = Field(
        5.0, description="initial weights are uniform within plus or minus this value"
    )
    validation_starts: Annotated[int, within("validation_starts")] = Field(
        N_VALIDATION,
        description="number of starts on which the champion is chosen; evolution does "
        "not use them",
    )
    finalists: Annotated[int, within("finalists")] = Field(
        5,
        description="number of the best candidates on a kinematic robot, among which "
        "the champion is chosen on wheels; 0: the champion is the best on the "
        "kinematic robot; without effect on other robots",
    )
    test_starts: Annotated[int, within("test_starts")] = Field(
        N_TEST,
        description="number of other starts on which the champion is tested; evolution "
        "does not use them",
    )
    optimizer: OptimizerConfig

    @model_validator(mode="after")
    def _of_robots_there_are(self) -> Self:
        """Refuse conditions that exclude each other."""
        _ = self.conditions
        return self

    @property
    def climbs(self) -> bool:
        """Whether a run goes on to wheels, if its budget suffices for that."""
        return is_kinematic(self.robot) and self.climb < 1

    @property
    def has_finalists(self) -> bool:
        """Whether the best on a kinematic robot are compared on wheels."""
        return is_kinematic(self.robot) and self.finalists > 0

    @property
    def conditions(self) -> Conditions:
        """Noise, randomisation and calibration of the robots."""
        return Conditions(
            self.noise, self.randomise, self.calibration, self.randomise_all
        )

    @property
    def task(self) -> TaskParameters:
        """Length, fitness, sensors and speeds of a trial."""
        return TaskParameters.of(self)

    @property
    def budget(self) -> int:
        """Number of trials that evolution may use."""
        return self.evaluations * self.trials

    @property
    def setting(self) -> Setting:
        """Arena, task and start clearance of the trials."""
        return Setting(self.arena, self.task, self.start_clearance)

    @property
    def topology(self) -> Topology:
        """Topology of the networks that genomes decode to."""
        if self.network in NETWORKS:
            return NETWORKS[self.network](self.hidden, self.biases)
        return OwnNetwork(self.network)

    @property
    def own_parts(self) -> dict[str, str]:
        """SHA-256 of the files of the user's own parts, by the parts' names.

        Raises:
            UserError: if one of them cannot be loaded.
        """
        names = (self.fitness, self.network, self.optimizer.algorithm)
        return {name: own_part(name).sha256 for name in names if is_own(name)}

    @property
    def search_space(self) -> SearchSpace:
        """Bounds and initial range of genomes."""
        return SearchSpace(
            genes=self.topology.n_genes,
            lower=-self.weight_bound,
            upper=self.weight_bound,
            init_lower=-self.weight_init,
            init_upper=self.weight_init,
        )

    def located(self) -> Self:
        """The config with absolute paths."""
        places = {
            "robot": absolute(self.robot),
            "arena": absolute(self.arena),
            "fitness": located(self.fitness),
            "network": located(self.network),
        }
        return self.model_copy(update=places)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the config as text, because a user's classes belong to no module."""
        return ExperimentConfig.from_yaml, (self.to_yaml(), "config")

    def to_yaml(self) -> str:
        """The resolved config: every key, in the order above."""
        return to_yaml(self.model_dump())

    @classmethod
    def from_yaml(cls, text: str, where: str) -> "ExperimentConfig":
        """The config that `to_yaml` wrote; missing keys get their defaults.

        Raises:
            UserError: beginning with `where`, if the text is not a config.
        """
        return cls.parsed(parse_yaml(text, where), where)

    @classmethod
    def parsed(cls, fields: Any, where: str) -> "ExperimentConfig":
        """The config with these keys and values.

        Raises:
            UserError: beginning with `where`, if a key or a value is invalid.
        """
        if not isinstance(fields, dict):
            raise UserError(
                f"{where}: expected a mapping of keys to values, got {shown(fields)}"
            )
        kind, fields = _kind_for(fields)
        try:
            return kind.model_validate(fields)
        except ValidationError as error:
            optimizer: Any = kind.model_fields["optimizer"].annotation
            problem = one_line(error, list(kind.model_fields), optimizer)
            raise UserError(f"{where}: {problem}") from None


def _kind_for(fields: dict) -> tuple[type[ExperimentConfig], dict]:
    """The config class for these fields, and the fields with the optimiser's full path.

    Raises:
        UserError: if they name a user's optimiser that cannot be loaded.
    """
    optimizer: Any = fields.get("optimizer")
    algorithm = optimizer.get("algorithm") if isinstance(optimizer, dict) else None
    if not (isinstance(algorithm, str) and is_own(algorithm)):
        return ExperimentConfig, fields
    algorithm = located(algorithm)
    own = fields | {"optimizer": optimizer | {"algorithm": algorithm}}
    return config_of_own_optimizer(algorithm), own


@cache
def config_of_own_optimizer(algorithm: str) -> type[ExperimentConfig]:
    """`ExperimentConfig` with the parameters of a user's optimiser.

    Raises:
        UserError: if the optimiser cannot be loaded.
    """
    kind = own_parameters(algorithm)
    strict: Any = Annotated[kind, strictly_typed(kind)]
    return create_model(
        ExperimentConfig.__name__, __base__=ExperimentConfig, optimizer=(strict, ...)
    )

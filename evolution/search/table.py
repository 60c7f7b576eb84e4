"""Table of optimisers: shipped ones and a user's own.

Only this module imports all algorithms, which are one module each. They share
`ask_tell` and `search_space`. The baselines beside the paper's are random search,
(1+1)-ES, CMA-ES, L-SHADE, OpenAI-ES and SSSHC. Hybrids are memetic DE, a sequence of
two searches, imitators and lifetime learning; policy gradient is without evolution.

    optimizer = make_optimizer(config.optimizer, config.search_space, rng)
    while spent + optimizer.next_size() <= budget:
        genomes = optimizer.ask()
        optimizer.tell(evaluate(genomes))
        spent += len(genomes)

An optimiser with `needs_lessons` costs `next_cost()` and is given its lessons between
ask and tell, as `generation_loop` does.
"""

from collections.abc import Callable, Mapping
from dataclasses import field, fields, is_dataclass, make_dataclass
from functools import cache
from typing import Any, Literal

from numpy.random import Generator

from epuck_mj.errors import UserError
from epuck_mj.host.own_parts import failure, is_own, own_part
from evolution.search.ask_tell import AskTellError, Optimizer
from evolution.search.cma_es import CmaEs, CmaEsParameters
from evolution.search.differential_evolution import (
    DifferentialEvolution,
    DifferentialEvolutionParameters,
)
from evolution.search.evolution_strategy import (
    EvolutionStrategy,
    EvolutionStrategyParameters,
)
from evolution.search.genetic_algorithm import (
    GeneticAlgorithm,
    GeneticAlgorithmParameters,
)
from evolution.search.imitators import Imitators, ImitatorsParameters
from evolution.search.l_shade import LShade, LShadeParameters
from evolution.search.lifetime_learning import (
    LifetimeLearning,
    LifetimeLearningParameters,
)
from evolution.search.memetic_de import MemeticDe, MemeticDeParameters
from evolution.search.openai_es import OpenAiEs, OpenAiEsParameters
from evolution.search.policy_gradient import PolicyGradient, PolicyGradientParameters
from evolution.search.random_search import RandomSearch, RandomSearchParameters
from evolution.search.search_space import SearchSpace
from evolution.search.sequence import Sequence, SequenceParameters
from evolution.search.ssshc import Ssshc, SsshcParameters

__all__ = [
    "ALGORITHMS",
    "AskTellError",
    "Optimizer",
    "OptimizerParameters",
    "SearchSpace",
    "make_optimizer",
]


OptimizerParameters = (
    DifferentialEvolutionParameters
    | GeneticAlgorithmParameters
    | RandomSearchParameters
    | EvolutionStrategyParameters
    | CmaEsParameters
    | LShadeParameters
    | OpenAiEsParameters
    | SsshcParameters
    | MemeticDeParameters
    | SequenceParameters
    | ImitatorsParameters
    | LifetimeLearningParameters
    | PolicyGradientParameters
)

Maker = Callable[[Any, SearchSpace, Generator], Optimizer]
# (parameters of that kind, space, rng) -> optimiser
MAKERS: Mapping[type[OptimizerParameters], Maker] = {
    DifferentialEvolutionParameters: DifferentialEvolution,
    GeneticAlgorithmParameters: GeneticAlgorithm,
    RandomSearchParameters: RandomSearch,
    EvolutionStrategyParameters: EvolutionStrategy,
    CmaEsParameters: CmaEs,
    LShadeParameters: LShade,
    OpenAiEsParameters: OpenAiEs,
    SsshcParameters: Ssshc,
    MemeticDeParameters: MemeticDe,
    SequenceParameters: Sequence,
    ImitatorsParameters: Imitators,
    LifetimeLearningParameters: LifetimeLearning,
    PolicyGradientParameters: PolicyGradient,
}

ALGORITHMS: Mapping[str, type[OptimizerParameters]] = {
    kind.algorithm: kind for kind in MAKERS
}
"""Classes of parameters by the name of their `algorithm`."""


def parameters_kind(algorithm: str) -> type:
    """The dataclass of an algorithm's parameters: a shipped one's, or `my.py:Class`'s.

    Raises:
        UserError: if there is no such algorithm, or it is not as `own_parameters` says.
    """
    if algorithm in ALGORITHMS:
        return ALGORITHMS[algorithm]
    if is_own(algorithm):
        return own_parameters(algorithm)
    raise UserError(
        f"unknown algorithm '{algorithm}'; available: {', '.join(ALGORITHMS)}, or "
        "my.py:Class for an optimiser of your own"
    )


@cache
def own_parameters(algorithm: str) -> type:
    """The parameters class of a user's `Optimizer`, with its `algorithm`.

    The user's class has them as its attribute `Parameters`: a frozen dataclass in which
    everything has a default.

    Raises:
        UserError: if the class is no `Optimizer`, or its `Parameters` are otherwise.
    """
    kind = own_part(algorithm).value
    if not (isinstance(kind, type) and issubclass(kind, Optimizer)):
        raise UserError(
            f"optimiser '{algorithm}': expected a subclass of "
            f"evolution.search.ask_tell.Optimizer, got {kind!r}"
        )
    parameters = getattr(kind, "Parameters", None)
    if not (isinstance(parameters, type) and is_dataclass(parameters)):
        raise UserError(
            f"optimiser '{algorithm}': expected a frozen dataclass as its attribute "
            f"Parameters, got {parameters!r}"
        )
    try:
        parameters()
        return make_dataclass(
            parameters.__name__,
            [("algorithm", Literal[algorithm], field(default=algorithm))],
            bases=(parameters,),
            # the configuration reads this: a misspelt key is refused
            namespace={
                "__pydantic_config__": {"extra": "forbid"},
                "__doc__": parameters.__doc__,
                "__module__": parameters.__module__,
            },
            frozen=True,
        )
    except Exception as error:
        raise UserError(
            f"optimiser '{algorithm}': its Parameters {failure(error)}; expected a "
            "frozen dataclass in which everything has a default"
        ) from None


def make_optimizer(
    parameters: OptimizerParameters, space: SearchSpace, rng: Generator
) -> Optimizer:
    """An optimiser at generation 0 of the kind that `parameters` belong to.

    Args:
        parameters: what it is made of.
        space: where it searches.
        rng: the source of all its randomness, its own from here on.

    Raises:
        ValueError: the optimiser cannot search this space.
        UserError: a user's optimiser fails.
    """
    if not is_own(parameters.algorithm):
        return MAKERS[type(parameters)](parameters, space, rng)
    kind = own_part(parameters.algorithm).value
    # its own Parameters, which know nothing of algorithms
    keys = [each.name for each in fields(kind.Parameters)]
    own = {key: getattr(parameters, key) for key in keys}
    try:
        return kind(kind.Parameters(**own), space, rng)
    except ValueError:
        raise
    except Exception as error:
        raise UserError(
            f"optimiser '{parameters.algorithm}' {failure(error)}"
        ) from None


def searches(parameters: Any) -> list[Any]:
    """Parameters of the searches that a hybrid is made of; of any other, itself."""
    parts = [getattr(parameters, name, None) for name in ("evolution", "first", "then")]
    return [part for part in parts if part is not None] or [parameters]

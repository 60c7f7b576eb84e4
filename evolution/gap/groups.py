"""Groups of policies: of one experiment at one speed, or of one speed."""

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

from epuck_mj.policies.wall_follower import YARDSTICK
from evolution.named_policies import NamedPolicy
from evolution.pages.words import YARDSTICK_LABEL, experiment_label
from evolution.study.directory import PREFIX


def experiments(policies: Sequence[NamedPolicy]) -> dict[str, list[int]]:
    """Policies by experiment, named by its path if experiments share a name.

    Those that are driven slower than they evolved are groups of their own.
    """
    places: dict[tuple[Path, str], list[int]] = {}
    for i, policy in enumerate(policies):
        path = Path(policy.source)
        place = path.parent if path.name.startswith(PREFIX) else path
        places.setdefault((place, policy.variant), []).append(i)
    names = Counter(place.name for place in {place for place, _ in places})
    return {
        _with(place.name if names[place.name] == 1 else place.as_posix(), variant): of
        for (place, variant), of in places.items()
    }


def labels(
    policies: Sequence[NamedPolicy], groups: Mapping[str, Sequence[int]]
) -> dict[str, str]:
    """Names for readers of the groups that `experiments` found."""
    found = {}
    for group, members in groups.items():
        policy = policies[members[0]]
        plain = group.removesuffix(policy.variant).rstrip()
        name = experiment_label(plain, policy.config)
        name = YARDSTICK_LABEL if plain == YARDSTICK else name
        found[group] = _with(name, policy.variant)
    return found


def _with(name: str, variant: str) -> str:
    return f"{name} {variant}".rstrip()


def peers(policies: Sequence[NamedPolicy]) -> dict[str, list[int]]:
    """Policies by their full speed.

    A slower one has less nominal fitness and keeps more of it anywhere: in one ranking
    that would pass for a relation of the two.
    """
    found: dict[str, list[int]] = {}
    for i, policy in enumerate(policies):
        found.setdefault(f"{policy.task.speeds.forward:.3g} m/s", []).append(i)
    return found

"""Groups of policies: of one experiment, or of one speed."""

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

from epuck_mj.policies.wall_follower import YARDSTICK
from evolution.named_policies import NamedPolicy
from evolution.pages.words import YARDSTICK_LABEL, experiment_label
from evolution.study.directory import PREFIX


def experiments(policies: Sequence[NamedPolicy]) -> dict[str, list[int]]:
    """Policies by experiment, named by its path if experiments share a name."""
    places: dict[Path, list[int]] = {}
    for i, policy in enumerate(policies):
        path = Path(policy.source)
        place = path.parent if path.name.startswith(PREFIX) else path
        places.setdefault(place, []).append(i)
    names = Counter(place.name for place in places)
    return {
        place.name if names[place.name] == 1 else place.as_posix(): members
        for place, members in places.items()
    }


def labels(
    policies: Sequence[NamedPolicy], groups: Mapping[str, Sequence[int]]
) -> dict[str, str]:
    """Names for readers of the groups that `experiments` found."""
    return {
        group: YARDSTICK_LABEL
        if group == YARDSTICK
        else experiment_label(group, policies[members[0]].config)
        for group, members in groups.items()
    }


def peers(policies: Sequence[NamedPolicy]) -> dict[str, list[int]]:
    """Policies by their full speed.

    A slower one earns less at home and keeps more of it wherever it is: in one ranking
    that would pass for a relation of the two.
    """
    found: dict[str, list[int]] = {}
    for i, policy in enumerate(policies):
        found.setdefault(f"{policy.task.speeds.forward:.3g} m/s", []).append(i)
    return found

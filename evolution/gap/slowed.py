"""Slowed policies: the control of what speed alone does.

A champion that is driven slower has less fitness and crashes less often, without any
evolution. What another one has learned is what it has more than that.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from epuck_mj.step.motors import Speeds
from evolution.named_policies import NamedPolicy


def with_slowed(
    policies: Sequence[NamedPolicy], speeds: Sequence[float]
) -> list[NamedPolicy]:
    """Policies, each followed by itself at the full speeds below its own [m/s]."""
    return [each for policy in policies for each in _at_speeds(policy, speeds)]


def _at_speeds(policy: NamedPolicy, speeds: Sequence[float]) -> Iterator[NamedPolicy]:
    yield policy
    for speed in dict.fromkeys(speeds):
        if speed < policy.task.speeds.forward:
            yield slowed(policy, speed)


def slowed(policy: NamedPolicy, speed: float) -> NamedPolicy:
    """A policy with another full speed [m/s], whose wheels turn in the same ratios.

    Raises:
        ValueError: if no e-puck has that speed.
    """
    own = policy.task.speeds
    slower = Speeds(speed, own.turn * speed / own.forward)
    variant = f"{policy.variant} at {speed:g} m/s".lstrip()
    return replace(policy, task=replace(policy.task, speeds=slower), variant=variant)

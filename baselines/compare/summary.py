"""The comparison in a few figures, with intervals over training seeds and drives (:mod:`baselines.evaluation.statistics`)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from baselines.compare.result import Group
from baselines.compare.results import Comparison
from baselines.evaluation.statistics import NOTHING, Estimate, estimate_iqm, estimate_mean, probability_of_improvement
from flexdrive_gym.recording import FloatArray
from flexdrive_gym.units import measured_in


@dataclass(frozen=True)
class Summary:
    """One group of controllers over the drawn drives (the identified drive where none were drawn).

    Attributes
    ----------
    name
        Of the group.
    seeds
        Number of members.
    rms, vibration, effort
        Interquartile means along the handout's trajectory [mm], [V mm], [V].
    failures
        Mean share of runs that do not settle in every dwell, or are unstable.
    effects
        Interquartile mean of rms with each left-out effect [mm].
    effect_failures
        Mean share of effects with which it fails.
    unseen
        Reference to the interquartile mean of rms [mm].
    """

    name: str
    seeds: int
    rms: Estimate = field(metadata=measured_in("mm"))
    vibration: Estimate = field(metadata=measured_in("V mm"))
    effort: Estimate = field(metadata=measured_in("V"))
    failures: Estimate
    effects: Estimate = field(metadata=measured_in("mm"))
    effect_failures: Estimate
    unseen: Mapping[str, Estimate] = field(metadata=measured_in("mm"))


@dataclass(frozen=True)
class Improvement:
    """How often a learnt group is better than a classical design on the same drive.

    Attributes
    ----------
    learnt, classical
        Names of the groups.
    rms, vibration, effort
        Along the handout's trajectory over the drawn drives.
    effects, unseen
        Of rms, over the left-out effects, and over all other references, each a stratum.
    """

    learnt: str
    classical: str
    rms: Estimate
    vibration: Estimate
    effort: Estimate
    effects: Estimate
    unseen: Estimate


@lru_cache(maxsize=4)
def summarise(comparison: Comparison) -> tuple[tuple[Summary, ...], tuple[Improvement, ...]]:
    """Return a summary per group, and for each pair of a learnt and a classical group who is better."""
    groups = comparison.groups
    learnt, classical = ([g for g in groups if g.learnt is wanted] for wanted in (True, False))
    pairs = tuple(_improvement(comparison, a, b) for a in learnt for b in classical)
    return tuple(_summary(comparison, g) for g in groups), pairs


def _summary(comparison: Comparison, group: Group) -> Summary:
    drawn, effects = comparison.where(), comparison.where("effect")

    def failed(chosen: np.ndarray) -> FloatArray:
        return 1.0 - group.table("success", chosen)

    return Summary(
        name=group.name,
        seeds=len(group.results),
        rms=estimate_iqm([group.table("rms", drawn)]),
        vibration=estimate_iqm([group.table("vibration", drawn)]),
        effort=estimate_iqm([group.table("effort", drawn)]),
        failures=estimate_mean([failed(drawn)]),
        effects=estimate_iqm([group.table("rms", effects)]) if len(effects) else NOTHING,
        effect_failures=estimate_mean([failed(effects)]) if len(effects) else NOTHING,
        unseen={
            name: estimate_iqm([group.table("rms", comparison.where(None, name))]) for name in comparison.references
        },
    )


def _improvement(comparison: Comparison, learnt: Group, classical: Group) -> Improvement:
    drawn, effects = comparison.where(), comparison.where("effect")
    others = [comparison.where(None, name) for name in comparison.references]

    def better(measure: str, *strata: np.ndarray) -> Estimate:
        chosen = [cases for cases in strata if len(cases)]
        ours, theirs = ([g.table(measure, cases) for cases in chosen] for g in (learnt, classical))
        return probability_of_improvement(ours, theirs)

    return Improvement(
        learnt=learnt.name,
        classical=classical.name,
        rms=better("rms", drawn),
        vibration=better("vibration", drawn),
        effort=better("effort", drawn),
        effects=better("rms", effects),
        unseen=better("rms", *others),
    )

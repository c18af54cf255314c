r"""Terms compared: what changed on the same rig since an earlier term.

The ratio of a parameter between two terms has the variance :math:`s_a^2 + s_b^2` of its logarithm, both from the spread between
runs, with Welch's degrees of freedom. p-values are corrected over all comparisons of a pair of terms (Holm).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.stats import t as student

from baselines.term.outliers import ALPHA, predicted, tau_squared, usable

Parameters = Mapping[str, Mapping[str, Any]]
ALL_RIGS = "all rigs"


@dataclass(frozen=True)
class Change:
    """How a parameter of a rig changed between two terms.

    Attributes
    ----------
    rig
        Name, or ``all rigs`` for the mean over those that are in both terms.
    parameter, before, after
        Which, and the terms.
    ratio, ci95
        Of the later value to the earlier one.
    p_value
        Of no change, corrected.
    """

    rig: str
    parameter: str
    before: str
    after: str
    ratio: float
    ci95: tuple[float, float]
    p_value: float

    @property
    def significant(self) -> bool:
        """Whether it changed, at 5 % over all comparisons."""
        return self.p_value < ALPHA

    def sentence(self) -> str:
        """Say it: ``since winter 2022 d1 of rig 3 rose by 40 % [25, 58]``."""
        change, low, high = (100.0 * (x - 1.0) for x in (self.ratio, *self.ci95))
        rig = f"the mean of {self.rig}" if self.rig == ALL_RIGS else self.rig
        since = f"since {self.before.replace('_', ' ')} {self.parameter} of {rig}"
        if not self.significant:
            corrected = " after correction for multiple comparisons" if low * high > 0.0 else ""
            return f"{since} did not change significantly{corrected}: {change:+.0f} % [{low:+.0f}, {high:+.0f}]"
        if change > 0.0:
            return f"{since} rose by {change:.0f} % [{low:.0f}, {high:.0f}]"
        return f"{since} fell by {-change:.0f} % [{-high:.0f}, {-low:.0f}]"


def changes(terms: Mapping[str, Mapping[str, Parameters]]) -> tuple[Change, ...]:
    """Return what changed from each term to the next, rig by rig, and on the mean of all that were there in both.

    Parameters
    ----------
    terms
        Term to rig to parameters, in order of time. Two terms of one group each are of the same rig, whatever it is called.
    """
    found: list[Change] = []
    for before, after in pairwise(terms):
        old, new = terms[before], terms[after]
        pairs = [(rig, old[rig], new[rig]) for rig in new if rig in old]
        if not pairs and len(old) == len(new) == 1:
            pairs = [("the rig", next(iter(old.values())), next(iter(new.values())))]
        compared = [c for rig, a, b in pairs for c in _rig_changes(rig, a, b, before, after)]
        found += _corrected(compared) + _corrected(_mean_changes(compared, pairs, before, after))
    return tuple(found)


def _logs(p: Mapping[str, Any]) -> tuple[float, float, float] | None:
    if not usable(p):
        return None
    return math.log(p["value"]), p["log_se"], p["degrees"]


def _rig_changes(rig: str, old: Parameters, new: Parameters, before: str, after: str) -> list[Change]:
    found = []
    for name in new:
        a, b = _logs(old[name]) if name in old else None, _logs(new[name])
        if a is None or b is None or old[name]["unit"] != new[name]["unit"]:
            continue
        variance = a[1] ** 2 + b[1] ** 2
        degrees = variance**2 / (a[1] ** 4 / a[2] + b[1] ** 4 / b[2])
        found.append(_change(rig, name, before, after, b[0] - a[0], math.sqrt(variance), degrees))
    return found


def _mean_changes(compared: Sequence[Change], pairs: Sequence[Any], before: str, after: str) -> list[Change]:
    """Return the mean change over rigs, where rigs may differ in how they changed."""
    found = []
    for name in dict.fromkeys(c.parameter for c in compared):
        own = [c for c in compared if c.parameter == name]
        if len(own) < 3 or len(pairs) < 3:
            continue
        y = np.log([c.ratio for c in own])
        s = np.array([(math.log(c.ci95[1]) - math.log(c.ci95[0])) / (2.0 * 1.96) for c in own])
        mean, _ = predicted(y, s)
        error = 1.0 / math.sqrt(float(np.sum(1.0 / (s**2 + tau_squared(y, s)))))
        found.append(_change(ALL_RIGS, name, before, after, mean, error, len(own) - 1.0))
    return found


def _change(rig: str, name: str, before: str, after: str, log: float, error: float, degrees: float) -> Change:
    half = float(student.ppf(0.975, degrees)) * error
    p = 2.0 * float(student.sf(abs(log) / error, degrees))
    return Change(rig, name, before, after, math.exp(log), (math.exp(log - half), math.exp(log + half)), p)


def _corrected(found: Sequence[Change]) -> list[Change]:
    """Return changes with Holm's p-values, in their own order."""
    order = sorted(range(len(found)), key=lambda k: found[k].p_value)
    largest, fixed = 0.0, {}
    for rank, k in enumerate(order):
        largest = max(largest, min(1.0, found[k].p_value * (len(found) - rank)))
        fixed[k] = largest
    return [replace(c, p_value=fixed[k]) for k, c in enumerate(found)]

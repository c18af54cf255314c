r"""Who stands out: a rig unlike the others, a wrong sign, an encoder that fails, recordings of another group.

A group's logarithm :math:`y_i` with standard error :math:`s_i` is compared with what the others predict: their mean with weights
:math:`1/(s_j^2 + \tau^2)`, where the variance between rigs :math:`\tau^2` makes Cochran's Q its expectation (R. Paule, J. Mandel,
J. Res. NBS 87, 1982),

.. math:: z_i = \frac{y_i - \mu_{-i}}{\sqrt{s_i^2 + \tau_{-i}^2 + \operatorname{var}(\mu_{-i})}},

Student's t with as many degrees of freedom as there are others, less one. Two that are alike hide each other, so the most
unlikely group of a parameter is taken out, then the most unlikely of the rest, up to a third of all; those taken out up to the
last one that is significant stand out (B. Rosner, Technometrics 25, 1983), each judged by the groups that do not. p-values are
multiplied by the number of groups and parameters.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from scipy.optimize import brentq
from scipy.stats import fisher_exact
from scipy.stats import t as student

Kind = Literal["parameter", "fit", "sign", "encoder", "copy"]
# stands for the error of the fit among parameters
FIT = "rms"
ALPHA = 0.05
# others that it takes to say what is usual
FEWEST = 4
_LARGEST_TAU = 10.0
# a parameter without influence on the residuals has no error
_NO_ERROR = 1e-9


@dataclass(frozen=True)
class Outlier:
    """One thing that stands out.

    Attributes
    ----------
    group
        Label.
    kind
        ``parameter``, ``fit``, ``sign``, ``encoder`` or ``copy``.
    what
        Parameter, place, or the other group.
    p_value
        After correction; ``None`` where there is no test.
    sentence
        What stands out and what to do.
    """

    group: str
    kind: Kind
    what: str
    p_value: float | None
    sentence: str


@dataclass(frozen=True)
class Apart:
    """A group whose parameter differs from the others': ratio to what they predict, with 95 % interval."""

    group: str
    parameter: str
    ratio: float
    ci95: tuple[float, float]
    p_value: float


def usable(estimate: Mapping[str, Any]) -> bool:
    """Whether an estimate can be compared: known to within a factor of seven, and not without any influence on the fit."""
    return bool(estimate["value"] > 0.0 and _NO_ERROR < estimate["log_se"] < 1.0)


def tau_squared(y: np.ndarray, s: np.ndarray) -> float:
    """Return the variance between units by Paule and Mandel."""

    def excess(tau2: float) -> float:
        w = 1.0 / (s**2 + tau2)
        return float(np.sum(w * (y - np.sum(w * y) / np.sum(w)) ** 2) - (len(y) - 1))

    if excess(0.0) <= 0.0:
        return 0.0
    return float(brentq(excess, 0.0, _LARGEST_TAU)) if excess(_LARGEST_TAU) < 0.0 else _LARGEST_TAU


def predicted(y: np.ndarray, s: np.ndarray) -> tuple[float, float]:
    """Return mean and standard deviation of another unit that units with values y and errors s predict."""
    tau2 = tau_squared(y, s)
    w = 1.0 / (s**2 + tau2)
    return float(np.sum(w * y) / np.sum(w)), math.sqrt(tau2 + 1.0 / float(np.sum(w)))


def apart(parameters: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> tuple[Apart, ...]:
    """Return what stands out among the parameters of groups, strongest first.

    Parameters
    ----------
    parameters
        Group to parameter to its ``value`` and ``log_se``.
    """
    table = {
        (group, name): (math.log(p["value"]), p["log_se"])
        for group, own in parameters.items()
        for name, p in own.items()
        if usable(p)
    }
    names = list(dict.fromkeys(name for _, name in table))
    found: list[Apart] = []
    for name in names:
        own = {group: v for (group, n), v in table.items() if n == name}
        strange = _strange(own, ALPHA / len(names))
        usual = {group: v for group, v in own.items() if group not in strange}
        found += [_judged(group, name, own[group], usual, len(own) * len(names)) for group in strange]
    return tuple(sorted(found, key=lambda a: a.p_value))


def _strange(own: Mapping[str, tuple[float, float]], alpha: float) -> list[str]:
    """Return the groups that stand out in one parameter, by generalised extreme studentised deviates."""
    left, last = dict(own), 0
    taken: list[str] = []
    while len(left) > FEWEST and len(taken) < len(own) // 3:
        p = {
            g: _judged(g, "", v, {o: w for o, w in left.items() if o != g}, len(left)).p_value for g, v in left.items()
        }
        taken.append(min(p, key=lambda g: p[g]))
        last = len(taken) if p[taken[-1]] < alpha else last
        del left[taken[-1]]
    return taken[:last]


def _judged(
    group: str, name: str, own: tuple[float, float], usual: Mapping[str, tuple[float, float]], tests: int
) -> Apart:
    others = np.array(list(usual.values()))
    y, s = own
    mean, sd = predicted(others[:, 0], others[:, 1])
    degrees = len(others) - 1
    p = 2.0 * float(student.sf(abs(y - mean) / math.hypot(s, sd), degrees))
    # the ratio itself: how far this rig is from the mean, not from another rig
    half = float(student.ppf(0.975, degrees)) * math.hypot(s, math.sqrt(_mean_variance(others)))
    return Apart(
        group, name, math.exp(y - mean), (math.exp(y - mean - half), math.exp(y - mean + half)), min(1.0, tests * p)
    )


def _mean_variance(others: np.ndarray) -> float:
    tau2 = tau_squared(others[:, 0], others[:, 1])
    return 1.0 / float(np.sum(1.0 / (others[:, 1] ** 2 + tau2)))


def failing_encoders(faulty: Mapping[str, Mapping[str, tuple[int, int]]]) -> list[tuple[str, str, int, int, float]]:
    """Return groups whose encoder fails in more recordings than the others' do.

    Parameters
    ----------
    faulty
        Group to encoder to recordings with a fault, and all.

    Returns
    -------
    list of (group, encoder, faulty, all, p)
        Fisher's exact test against all other groups, times the number of tests.
    """
    found = []
    tests = sum(len(own) for own in faulty.values())
    for group, own in faulty.items():
        for where, (bad, n) in own.items():
            rest = [other[where] for name, other in faulty.items() if name != group and where in other]
            if bad < 2 or not rest:
                continue
            others, of = sum(b for b, _ in rest), sum(m for _, m in rest)
            p = (
                float(fisher_exact(np.array([[bad, n - bad], [others, of - others]]), alternative="greater").pvalue)
                * tests
            )
            if p < ALPHA:
                found.append((group, where, bad, n, min(1.0, p)))
    return found


def in_words(found: Apart) -> str:
    """Say how far a rig's parameter is from the others'."""
    if found.parameter == FIT:
        return (
            f"the base model errs {found.ratio:.1f} [{found.ci95[0]:.1f}, {found.ci95[1]:.1f}] times as much as on the other "
            f"rigs (p = {found.p_value:.1g}): look at its recordings, and at what the diagnosis names"
        )
    low, high = sorted(100.0 * (x - 1.0) for x in found.ci95)
    change = 100.0 * (found.ratio - 1.0)
    side = "above" if change > 0.0 else "below"
    bounds = (low, high) if change > 0.0 else (-high, -low)
    advice = {"d": "clean and oil its guide", "b": "look at its bearings and its motor", "k": "look at its spring",
              "m": "look at the masses on its carts"}.get(found.parameter[0], "look at it")  # fmt: skip
    return (
        f"{found.parameter} lies {abs(change):.0f} % [{bounds[0]:.0f}, {bounds[1]:.0f}] {side} what the other rigs predict "
        f"(p = {found.p_value:.1g}); the rig may need service: {advice}"
    )


def listed(names: Sequence[str], most: int = 3) -> str:
    """Return the first few names, and how many more."""
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")

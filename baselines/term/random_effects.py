r"""What differs between rigs, between sessions of a rig, and between runs of a session: nested random effects.

The logarithms of the parameters in run k of session j of rig i are

.. math:: \theta_{ijk} = \mu + a_i + b_{ij} + c_{ijk}, \qquad
          a \sim N(0, D_\text{rig}),\ b \sim N(0, D_\text{session}),\ c \sim N(0, D_\text{run}),

with diagonal covariances, and every run says of its own :math:`\theta` a quadratic log-likelihood
:math:`h^T\theta - \tfrac12\theta^T A \theta` (:mod:`baselines.term.evidence`): the measurement's covariance is known, which mixed
models of statistics packages do not take. A level is integrated out in closed form: with :math:`S = D^{1/2}`,
:math:`M = I + S A S`, :math:`P = S M^{-1} S`,

.. math:: A' = A - A P A, \quad h' = h - A P h, \quad c' = c - \tfrac12 \log|M| + \tfrac12 h^T P h,

and what the members of a group say is added up. Integrating :math:`\mu` out too, over a flat prior, leaves the restricted
likelihood (REML; H. Patterson, R. Thompson, Biometrika 58, 1971; N. Laird, J. Ware, Biometrics 38, 1982), which is maximised over
the standard deviations. An interval holds the values of one standard deviation at which twice the log-likelihood falls by at most
3.84, the others held.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq, minimize

from baselines.term.evidence import RunEvidence
from flexdrive_gym.recording import FloatArray

LEVELS = ("rig", "session", "run")
# standard deviations of logarithms: a factor of seven at most, and what nobody would notice
_LEAST, MOST, _START = 1e-4, 2.0, 0.1
_FALL = 3.84 / 2.0


@dataclass(frozen=True)
class Spread:
    """Standard deviation of a parameter's logarithm at one level: 0.1 is about 10 %.

    Attributes
    ----------
    parameter, level
        Of what, and between what.
    value, ci95
        An interval that begins at 0 says that the level need not be there.
    units
        How many rigs, sessions or runs it is estimated from.
    """

    parameter: str
    level: str
    value: float
    ci95: tuple[float, float]
    units: int


@dataclass(frozen=True)
class Rig:
    """What the runs of one rig say, session by session; parameters in the order of the whole."""

    name: str
    sessions: tuple[tuple[RunEvidence, ...], ...]


@dataclass(frozen=True, eq=False)
class _Message:
    """Quadratic log-likelihoods, one for each unit: shapes (n, p, p), (n, p); their constants are summed."""

    A: FloatArray
    h: FloatArray
    constant: float

    def without(self, deviations: FloatArray) -> _Message:
        """Integrate every unit's own effect out."""
        S = deviations
        M = np.eye(len(S)) + S[:, None] * self.A * S
        P = S[:, None] * np.linalg.solve(M, np.broadcast_to(np.diag(S), self.A.shape))
        AP = self.A @ P
        gain = np.einsum("ni,nij,nj->", self.h, P, self.h)
        return _Message(
            self.A - AP @ self.A,
            self.h - np.einsum("nij,nj->ni", AP, self.h),
            float(self.constant - 0.5 * np.linalg.slogdet(M)[1].sum() + 0.5 * gain),
        )

    def summed(self, owners: np.ndarray) -> _Message:
        """Add up what the units of each owner say."""
        n = int(owners.max()) + 1
        A, h = np.zeros((n, *self.A.shape[1:])), np.zeros((n, self.h.shape[1]))
        np.add.at(A, owners, self.A)
        np.add.at(h, owners, self.h)
        return _Message(A, h, self.constant)


def random_effects(names: Sequence[str], rigs: Sequence[Rig]) -> tuple[Spread, ...]:
    """Return the standard deviation of every parameter at every level that has at least two units in one of the next.

    Parameters
    ----------
    names
        Of the parameters that all evidence is about.
    rigs
        At least one.
    """
    p = len(names)
    runs = [e for rig in rigs for session in rig.sessions for e in session]
    session_of_run = np.array([k for k, s in enumerate(s for rig in rigs for s in rig.sessions) for _ in s])
    rig_of_session = np.array([k for k, rig in enumerate(rigs) for _ in rig.sessions])
    A = np.array([e.information for e in runs])
    h = np.array([e.score for e in runs])
    # about a common centre, which the answer does not depend on and rounding does
    centre = np.linalg.lstsq(A.sum(axis=0), h.sum(axis=0), rcond=1e-12)[0]
    bottom = _Message(A, h - A @ centre, 0.0)
    counts = {"rig": len(rigs), "session": len(rig_of_session), "run": len(runs)}
    above = {"rig": 1, "session": len(rigs), "run": len(rig_of_session)}
    # a level with one unit in each of the next cannot be told from that
    levels = [level for level in LEVELS if counts[level] > above[level]]

    def likelihood(x: np.ndarray) -> float:
        own = dict.fromkeys(LEVELS, np.zeros(p)) | {
            level: np.exp(x[k * p : (k + 1) * p]) for k, level in enumerate(levels)
        }
        message = bottom.without(own["run"]).summed(session_of_run)
        message = message.without(own["session"]).summed(rig_of_session)
        top = message.without(own["rig"]).summed(np.zeros(len(rigs), dtype=int))
        ridge = 1e-9 * np.eye(p)
        whole = top.A[0] + ridge
        mean = np.linalg.solve(whole, top.h[0])
        return float(top.constant + 0.5 * top.h[0] @ mean - 0.5 * np.linalg.slogdet(whole)[1])

    def loss(x: np.ndarray) -> float:
        return -likelihood(x)

    bounds = (float(np.log(_LEAST)), float(np.log(MOST)))
    found = minimize(
        loss,
        np.full(len(levels) * p, np.log(_START)),
        method="L-BFGS-B",
        bounds=[bounds] * (len(levels) * p),
    )
    best = np.asarray(found.x)
    return tuple(
        Spread(name, level, float(np.exp(best[k * p + i])), _interval(likelihood, best, k * p + i), counts[level])
        for k, level in enumerate(levels)
        for i, name in enumerate(names)
    )


def _interval(likelihood: Callable[[FloatArray], float], best: FloatArray, at: int) -> tuple[float, float]:
    """Return where the log-likelihood has fallen by 1.92; 0 where it does not fall on the way down."""
    top = likelihood(best)

    def fall(value: float) -> float:
        moved = best.copy()
        moved[at] = value
        return top - likelihood(moved) - _FALL

    low, high = float(np.log(_LEAST)), float(np.log(MOST))
    lower = 0.0 if fall(low) <= 0.0 else float(np.exp(brentq(fall, low, best[at], xtol=1e-3)))
    upper = MOST if fall(high) <= 0.0 else float(np.exp(brentq(fall, best[at], high, xtol=1e-3)))
    return lower, upper


def gathered(
    rows: Sequence[tuple[str, str, Sequence[str], Sequence[RunEvidence]]],
) -> tuple[tuple[str, ...], list[Rig]]:
    """Return parameters and rigs from rows of rig, term, parameters and evidence; a rig may have been there in several terms.

    A parameter that a row knows nothing of (a friction at zero) has no information there.
    """
    names = tuple(dict.fromkeys(n for _, _, own, _ in rows for n in own))
    rigs: dict[str, dict[tuple[str, str], list[RunEvidence]]] = {}
    for rig, term, own, evidence in rows:
        places = [names.index(n) for n in own]
        for e in evidence:
            A, h = np.zeros((len(names), len(names))), np.zeros(len(names))
            A[np.ix_(places, places)], h[places] = e.information, e.score
            whole = RunEvidence(e.recording, e.session, A, h)
            rigs.setdefault(rig, {}).setdefault((term, e.session), []).append(whole)
    return names, [Rig(name, tuple(map(tuple, sessions.values()))) for name, sessions in rigs.items()]


def as_json(spreads: Sequence[Spread]) -> list[dict[str, Any]]:
    """Return spreads for ``term.json``."""
    return [
        {"parameter": s.parameter, "between": f"{s.level}s", "sd_log": s.value, "ci95": list(s.ci95), "units": s.units}
        for s in spreads
    ]

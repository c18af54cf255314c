r"""The null distribution: what the same pipeline finds in data of this rig in which nothing is left out.

A draw is the present model's simulation plus the *actual* residual of a generous model, its sign (or, where recordings are few,
Webb's six-point multiplier) drawn for every recording. Colour, size and coherence with the motion stay what they are; what all
recordings share is gone. Every candidate's gain is computed in every draw as it is in the data. Each name is judged against its own
mean and spread over the draws, for a candidate that acts near reversals gains much in data that lack nothing; the largest over
the catalogue gives the p-value. M. Webb, Reworking wild bootstrap based inference for clustered errors, 2014.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexdrive_gym.recording import FloatArray
from identification.diagnosis.linear import Linear
from identification.diagnosis.score import Normal, studentised
from identification.diagnosis.settings import Settings

Name = tuple[str, str]


@dataclass(frozen=True, eq=False)
class Null:
    """Null distribution of a catalogue.

    Attributes
    ----------
    mean, spread
        Of every name's gain over the draws.
    largest : ndarray, shape (draws,)
        Largest standardised gain of any name.
    largest_z : ndarray, shape (draws,)
        Largest mean over standard error of any name.
    """

    mean: dict[Name, float]
    spread: dict[Name, float]
    largest: FloatArray
    largest_z: FloatArray

    def score(self, name: Name, gain: float) -> float:
        """Return a gain in spreads of its own null distribution above its mean."""
        typical = float(np.median(list(self.spread.values())))
        return (gain - self.mean.get(name, 0.0)) / self.spread.get(name, typical)

    def p_value(self, name: Name, gain: float) -> float:
        """Return how often the best of the catalogue gains as much where nothing is left out."""
        return float((1 + np.sum(self.largest >= self.score(name, gain))) / (len(self.largest) + 1))

    def p_of_z(self, z: float) -> float:
        """Return how often the most consistent of the catalogue is as consistent over recordings."""
        return float((1 + np.sum(self.largest_z >= z)) / (len(self.largest_z) + 1))


def null_of(linear: Linear, residual: FloatArray, settings: Settings, rng: np.random.Generator) -> Null:
    """Draw the null distribution.

    Parameters
    ----------
    linear
        All candidates around the present model.
    residual
        Raw rows of a generous model.
    """
    drawn = linear.against(residual)
    R = len(drawn.plain)
    signs = multipliers(settings.draws, R, settings.few, rng)
    base = _left_out(drawn.normal(), signs, settings.damping)
    gain: dict[Name, FloatArray] = {}
    z: dict[Name, FloatArray] = {}
    for entry in drawn.entries:
        each = 0.5 * (base - _left_out(drawn.normal(entry.columns), signs, settings.damping))
        total, own = each.sum(axis=1), studentised(each)
        name = entry.candidate.name
        if name in gain:
            better = total > gain[name]
            gain[name] = np.where(better, total, gain[name])
            z[name] = np.where(better, own, z[name])
        else:
            gain[name], z[name] = total, own
    mean = {n: float(np.mean(g)) for n, g in gain.items()}
    raw = {n: float(np.std(g)) for n, g in gain.items()}
    # a candidate that hardly changes anything has no spread to be judged by
    least = 0.25 * float(np.median(list(raw.values())))
    spread = {n: max(s, least, 1e-9) for n, s in raw.items()}
    largest = np.max([(g - mean[n]) / spread[n] for n, g in gain.items()], axis=0)
    # consistency counts only where there is a gain
    consistent = np.max([np.where(g > 0.0, z[n], -np.inf) for n, g in gain.items()], axis=0)
    return Null(mean, spread, np.asarray(largest), np.asarray(consistent))


def multipliers(draws: int, recordings: int, few: int, rng: np.random.Generator) -> FloatArray:
    """Return random multipliers of mean 0 and variance 1, shape (draws, recordings)."""
    if recordings >= few:
        return rng.choice([-1.0, 1.0], (draws, recordings))
    six = np.sqrt([0.5, 1.0, 1.5])
    return rng.choice(np.concatenate([-six, six]), (draws, recordings))


def _left_out(n: Normal, signs: FloatArray, damping: float) -> FloatArray:
    """Return the squares that the others' optimum leaves, for every draw and recording, shape (draws, R)."""
    H = n.information.sum(axis=0)
    total = signs @ n.gradient
    found = np.empty_like(signs)
    for r in range(len(n.square)):
        A = H - n.information[r]
        d = np.sqrt(np.maximum(np.diag(A), 1e-300))
        inverse = np.linalg.pinv(A / np.outer(d, d) + damping * np.eye(len(d)), rcond=1e-12, hermitian=True) / np.outer(d, d)
        s = signs[:, r]
        step = -(total - s[:, None] * n.gradient[r]) @ inverse
        found[:, r] = (
            s**2 * n.square[r]
            + 2.0 * s * (step @ n.score_gradient[r])
            + np.einsum("bi,ij,bj->b", step, n.score_information[r], step)
        )
    return found

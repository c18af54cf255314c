r"""The null distribution: what the same pipeline finds in data of this rig in which nothing is left out.

A draw is the present model's simulation plus the *actual* residual of a generous model, its sign (or, where recordings are few,
Webb's six-point multiplier) drawn for every recording, with the most probable run-to-run variability in it replaced by a random
one. Colour, size and coherence with the motion stay what they are; what all recordings share is gone, but for the track, which is
the same in all of them and is drawn as such. Every candidate's gain is computed in every draw as it is in the data. Each name is
judged against its own median and upper spread over the draws, for a candidate that acts near reversals gains much in data that
lack nothing; the largest over the catalogue gives the p-value. M. Webb, Reworking wild bootstrap based inference for clustered
errors, 2014.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexdrive_gym.recording import FloatArray
from identification.diagnosis.bench import Bench
from identification.diagnosis.linear import Linear
from identification.diagnosis.noise import amplitudes
from identification.diagnosis.nuisance import Direction, drawn
from identification.diagnosis.score import Normal, trimmed

Name = tuple[str, str]
# quantile that tells the spread of a null distribution's upper half, and what it is of a standard normal variable
_UPPER, _NORMAL = 0.9, 1.2816


@dataclass(frozen=True, eq=False)
class Null:
    """Null distribution of a catalogue.

    Attributes
    ----------
    mean, spread
        Centre and upper spread of every name's gain over the draws.
    largest : ndarray, shape (draws,)
        Largest standardised gain of any name.
    trimmed_mean, trimmed_spread, largest_trimmed
        The same of the gain without the recording that gains most.
    """

    mean: dict[Name, float]
    spread: dict[Name, float]
    largest: FloatArray
    trimmed_mean: dict[Name, float]
    trimmed_spread: dict[Name, float]
    largest_trimmed: FloatArray

    def score(self, name: Name, gain: float) -> float:
        """Return a gain in spreads of its own null distribution above its centre."""
        typical = float(np.median(list(self.spread.values())))
        return (gain - self.mean.get(name, 0.0)) / self.spread.get(name, typical)

    def p_value(self, name: Name, gain: float) -> float:
        """Return how often the best of the catalogue gains as much where nothing is left out."""
        return float((1 + np.sum(self.largest >= self.score(name, gain))) / (len(self.largest) + 1))

    def p_without_best(self, name: Name, gain: float) -> float:
        """Return the p-value of a gain that leaves out the recording that gains most."""
        score = (gain - self.trimmed_mean.get(name, 0.0)) / self.trimmed_spread.get(
            name, float(np.median(list(self.trimmed_spread.values())))
        )
        return float((1 + np.sum(self.largest_trimmed >= score)) / (len(self.largest_trimmed) + 1))


@dataclass(frozen=True, eq=False)
class _Draws:
    """Null draws as gradients of all columns.

    Attributes
    ----------
    plain, white : ndarray, shape (R, draws, M)
        In the metric of estimates and of scores.
    square : ndarray, shape (R, draws)
    """

    plain: FloatArray
    white: FloatArray
    square: FloatArray

    @classmethod
    def of(
        cls, linear: Linear, residual: FloatArray, found: Sequence[Direction], signs: FloatArray, amplitude: FloatArray
    ) -> _Draws:
        """Return the draws of a residual with signs, shape (draws, R), and amplitudes, shape (draws, R, directions)."""
        noise, parts = linear.noise, []
        D = np.column_stack([d.change for d in found]) if found else np.zeros((len(residual), 0))
        for r, rows in enumerate(noise.rows):
            w = noise.weights[rows][:, None]
            E = np.column_stack([residual[rows], D[rows]]) * w
            F = E
            if noise.modes:
                U = noise.modes[r]
                F = E - U @ (U.T @ E)
            C = linear.columns[rows] * w
            twice = F - noise.modes[r] @ (noise.modes[r].T @ F) if noise.modes else F
            mix = np.column_stack([signs[:, r], amplitude[:, r]])
            parts.append((mix @ (E.T @ C), mix @ (twice.T @ C), np.einsum("bi,ij,bj->b", mix, F.T @ F, mix)))
        return cls(*(np.array([p[i] for p in parts]) for i in range(3)))

    def left_out(self, n: Normal, columns: Sequence[int], damping: float) -> FloatArray:
        """Return the squares that the others' optimum leaves, for every draw and recording, shape (draws, R)."""
        plain, white = self.plain[:, :, columns], self.white[:, :, columns]
        H, total = n.information.sum(axis=0), plain.sum(axis=0)
        found = np.empty(self.square.T.shape)
        for r in range(len(n.square)):
            A = H - n.information[r]
            d = np.sqrt(np.maximum(np.diag(A), 1e-300))
            inverse = np.linalg.inv(A / np.outer(d, d) + damping * np.eye(len(d))) / np.outer(d, d)
            step = -(total - plain[r]) @ inverse
            own = np.sum((step @ n.score_information[r]) * step, axis=1)
            found[:, r] = self.square[r] + 2.0 * np.sum(step * white[r], axis=1) + own
        return found


def null_of(
    linear: Linear, bench: Bench, residual: FloatArray, found: Sequence[Direction], rng: np.random.Generator
) -> Null:
    """Draw the null distribution.

    Parameters
    ----------
    linear
        All candidates around the present model.
    residual
        Raw rows of a generous model.
    found
        Run-to-run variability.
    """
    settings, R = bench.settings, len(linear.plain)
    signs = multipliers(settings.draws, R, settings.few, rng)
    amplitude = drawn(found, linear.noise.scale, R, settings.draws, rng)
    rest = residual.copy()
    for rows, (a, _) in zip(
        bench.rows, amplitudes(bench, residual, found, linear.noise) if found else [], strict=False
    ):
        rest[rows] += np.column_stack([d.change[rows] * d.size for d in found]) @ a
    draws = _Draws.of(linear, rest, found, signs, amplitude)
    base = draws.left_out(linear.normal(), linear.base, settings.damping)
    gain: dict[Name, FloatArray] = {}
    less: dict[Name, FloatArray] = {}
    for entry in linear.entries:
        columns = [*linear.base, *entry.columns]
        each = 0.5 * (base - draws.left_out(linear.normal(entry.columns), columns, settings.damping))
        total, rest = each.sum(axis=1), trimmed(each)
        name = entry.candidate.name
        better = total > gain[name] if name in gain else np.ones(len(total), dtype=bool)
        gain[name] = np.where(better, total, gain.get(name, total))
        less[name] = np.where(better, rest, less.get(name, rest))
    return Null(*_standardised(gain), *_standardised(less))


def _standardised(gain: dict[Name, FloatArray]) -> tuple[dict[Name, float], dict[Name, float], FloatArray]:
    """Return every name's mean and spread over the draws, and the largest standardised gain of every draw."""
    mean = {n: float(np.median(g)) for n, g in gain.items()}
    # predicting others badly has no limit, predicting them well has: the spread that matters is that of the upper half
    raw = {n: (float(np.quantile(g, _UPPER)) - mean[n]) / _NORMAL for n, g in gain.items()}
    # a candidate that hardly changes anything has no spread to be judged by
    least = 0.25 * float(np.median(list(raw.values())))
    spread = {n: max(s, least, 1e-9) for n, s in raw.items()}
    largest = np.max([(g - mean[n]) / spread[n] for n, g in gain.items()], axis=0)
    return mean, spread, np.asarray(largest)


def multipliers(draws: int, recordings: int, few: int, rng: np.random.Generator) -> FloatArray:
    """Return random multipliers of mean 0 and variance 1, shape (draws, recordings)."""
    if recordings >= few:
        return rng.choice([-1.0, 1.0], (draws, recordings))
    six = np.sqrt([0.5, 1.0, 1.5])
    return rng.choice(np.concatenate([-six, six]), (draws, recordings))

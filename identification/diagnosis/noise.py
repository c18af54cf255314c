r"""The noise of every recording: a level of its own, and run-to-run variability as a covariance of low rank.

The rows of recording r have the covariance :math:`\Sigma_r = D_r S D_r^T + \operatorname{diag}(\sigma_{rc}^2)`, with the changes
:math:`D_r` of :mod:`identification.diagnosis.nuisance`. Rows are whitened with

.. math:: W = (I - U(1 - (1 + \lambda^2)^{-1/2}) U^T)\, \operatorname{diag}(1/\sigma), \qquad
   \operatorname{diag}(1/\sigma) D S^{1/2} = U \lambda V^T .

:math:`\sigma_{rc}` is half what the recording's residual shows and half what a model that misses the same share of every signal
would leave: each recording has a vote, however small its motion, and none can be given up for a quiet one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexdrive_gym.recording import FloatArray
from identification.diagnosis.bench import Bench
from identification.diagnosis.nuisance import Direction
from identification.diagnosis.score import Normal

# how far a group's standard deviation may go from its prior, as a factor: other rigs are quieter or rougher
_LEAST, _MOST = 0.25, 2.5
# singular values under which a direction is lost in the noise
_SEEN = 0.3


@dataclass(frozen=True, eq=False)
class Noise:
    """Covariance of the rows.

    Attributes
    ----------
    weights : ndarray, shape (N,)
        Inverse standard deviation of the independent part; 0 where no sample is valid.
    modes : list of ndarray, shape (rows of a recording, m)
        Directions that are damped, per recording.
    rows
        Rows of every recording.
    scale
        Group of directions to its standard deviation over the prior one.
    """

    weights: FloatArray
    modes: list[FloatArray]
    rows: list[slice]
    scale: dict[str, float]
    ridge: float = 1e-6

    def white(self, x: FloatArray, r: int) -> FloatArray:
        """Return whitened rows of one recording from raw rows of all, shape (N,) or (N, k)."""
        part = x[self.rows[r]]
        y = part * (self.weights[self.rows[r]] if x.ndim == 1 else self.weights[self.rows[r]][:, None])
        if self.modes:
            y = y - self.modes[r] @ (self.modes[r].T @ y)
        return np.asarray(y)

    def whitened(self, x: FloatArray) -> list[FloatArray]:
        """Return whitened rows of all recordings."""
        return [self.white(x, r) for r in range(len(self.rows))]

    def normal(self, J: FloatArray, e: FloatArray) -> Normal:
        """Return the normal equations of raw rows: weighted for estimates, whitened for scores."""
        both = np.column_stack([J, e])
        plain = [both[rows] * self.weights[rows][:, None] for rows in self.rows]
        white = [y - U @ (U.T @ y) for y, U in zip(plain, self.modes, strict=True)] if self.modes else plain
        return Normal.of(plain, white)


def first_noise(bench: Bench) -> Noise:
    """Return noise levels before anything was fitted: a share of every signal, and encoder counts."""
    variances = bench.floor + bench.settings.model_error * bench.signal
    return Noise(_weights(bench, variances), [], bench.rows, {})


def estimate(bench: Bench, residual: FloatArray, found: Sequence[Direction]) -> Noise:
    """Return the noise that a residual shows.

    Parameters
    ----------
    residual
        Raw rows of a generous model: one that lacks nothing that could be named.
    found
        Run-to-run variability around it.
    """
    rest, scale = residual, {d.group: 1.0 for d in found}
    variances = _variances(bench, residual)
    for _ in range(2):
        rest = _without(bench, residual, found, scale, variances)
        variances = _variances(bench, rest)
        scale = _scales(bench, residual, found, scale, variances)
    weights = _weights(bench, variances)
    if not found:
        return Noise(weights, [], bench.rows, scale)
    D = np.column_stack([d.change * d.size * scale[d.group] for d in found]) * weights[:, None]
    modes = []
    for rows in bench.rows:
        U, s, _ = np.linalg.svd(D[rows], full_matrices=False)
        seen = s > _SEEN
        modes.append(np.asarray(U[:, seen] * np.sqrt(1.0 - 1.0 / np.sqrt(1.0 + s[seen] ** 2))))
    return Noise(weights, modes, bench.rows, scale)


def amplitudes(
    bench: Bench, residual: FloatArray, found: Sequence[Direction], noise: Noise
) -> list[tuple[FloatArray, FloatArray]]:
    """Return the most probable amplitudes of every recording and their variances, relative to the prior, shape (k,)."""
    result = []
    for rows in bench.rows:
        D = np.column_stack([d.change[rows] * d.size for d in found]) * noise.weights[rows][:, None]
        s = np.array([noise.scale[d.group] for d in found])
        covariance = np.linalg.inv(D.T @ D + np.diag(s**-2.0))
        result.append((-covariance @ (D.T @ (residual[rows] * noise.weights[rows])), np.diag(covariance)))
    return result


def _variances(bench: Bench, rest: FloatArray) -> FloatArray:
    own, count = np.empty(len(bench.pieces)), np.empty(len(bench.pieces))
    for i, p in enumerate(bench.pieces):
        e = rest[p.rows][bench.valid[p.rows]]
        own[i], count[i] = float(np.mean(e**2)) if len(e) else 0.0, len(e)
    seen = count > 0
    excess = np.maximum(own - bench.floor, 0.0)
    share = float(np.median(excess[seen] / np.maximum(bench.signal[seen], 1e-12)))
    expected = bench.floor + share * bench.signal
    mine = bench.settings.own_share
    return np.maximum(mine * own + (1.0 - mine) * expected, bench.floor)


def _weights(bench: Bench, variances: FloatArray) -> FloatArray:
    weights = np.zeros(len(bench.valid))
    for i, p in enumerate(bench.pieces):
        weights[p.rows] = bench.valid[p.rows] / np.sqrt(variances[i])
    return weights


def _without(
    bench: Bench, residual: FloatArray, found: Sequence[Direction], scale: dict[str, float], variances: FloatArray
) -> FloatArray:
    """Return a residual without the most probable run-to-run variability."""
    if not found:
        return residual
    noise = Noise(_weights(bench, variances), [], bench.rows, scale)
    rest = residual.copy()
    for rows, (a, _) in zip(bench.rows, amplitudes(bench, residual, found, noise), strict=True):
        rest[rows] += np.column_stack([d.change[rows] * d.size for d in found]) @ a
    return rest


def _scales(
    bench: Bench, residual: FloatArray, found: Sequence[Direction], scale: dict[str, float], variances: FloatArray
) -> dict[str, float]:
    """Return the groups' standard deviations, one step of expectation maximisation; what all recordings share is physics."""
    if not found:
        return {}
    noise = Noise(_weights(bench, variances), [], bench.rows, scale)
    got = amplitudes(bench, residual, found, noise)
    mean, variance = np.array([a for a, _ in got]), np.array([v for _, v in got])
    own = np.var(mean, axis=0) + variance.mean(axis=0)
    groups = {d.group for d in found}
    square = {g: float(np.mean([o for o, d in zip(own, found, strict=True) if d.group == g])) for g in groups}
    return {g: float(np.clip(np.sqrt(s), _LEAST, _MOST)) for g, s in sorted(square.items())}

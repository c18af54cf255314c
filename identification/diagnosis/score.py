r"""Scores: by how much a candidate improves the prediction of recordings that its parameters were not estimated from.

Around an optimum the weighted residual of recording r is :math:`e_r + J_r \Delta`. With :math:`H_r = J_r^T J_r` and
:math:`g_r = J_r^T e_r`, the others' optimum and the square of the whitened residual :math:`W_r (e_r + J_r \Delta)` that it leaves
in r are

.. math::
   \Delta_{-r} = -\Bigl(\sum_{q \ne r} H_q\Bigr)^{-1} \sum_{q \ne r} g_q, \qquad
   S_r = e_r^T W_r^2 e_r + 2\,\Delta_{-r}^T J_r^T W_r^2 e_r + \Delta_{-r}^T J_r^T W_r^2 J_r \Delta_{-r} .

The score of a candidate in r is the gain of predictive log-likelihood, half of S without it minus half of S with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from flexdrive_gym.recording import FloatArray


@dataclass(frozen=True, eq=False)
class Normal:
    """Normal equations of every recording, in the metric of estimates and in that of scores.

    Attributes
    ----------
    information, gradient : ndarray, shapes (R, p, p) and (R, p)
        Of estimates; the gradient is that of half the square.
    score_information, score_gradient, square : ndarray, shapes (R, p, p), (R, p) and (R,)
        Of scores.
    signs : ndarray, shape (p,), or None
        Sign that a solution must have where it is not 0: a mass is positive. ``None`` where none is asked for.
    """

    information: FloatArray
    gradient: FloatArray
    score_information: FloatArray
    score_gradient: FloatArray
    square: FloatArray
    signs: FloatArray | None = None

    @classmethod
    def of(cls, plain: Sequence[FloatArray], white: Sequence[FloatArray], signs: FloatArray | None = None) -> Normal:
        """Return the normal equations of rows whose last column is the residual, per recording in both metrics."""
        one = np.array([y.T @ y for y in plain])
        two = one if white is plain else np.array([y.T @ y for y in white])
        return cls.from_products(one, two, signs)

    @classmethod
    def from_products(cls, one: FloatArray, two: FloatArray, signs: FloatArray | None = None) -> Normal:
        """Return the normal equations from products of columns whose last is the residual, shape (R, p + 1, p + 1)."""
        return cls(one[:, :-1, :-1], one[:, :-1, -1], two[:, :-1, :-1], two[:, :-1, -1], two[:, -1, -1], signs)

    def solve(self, damping: float = 1e-10) -> FloatArray:
        """Return the step to the common optimum, shape (p,)."""
        return self.step(self.information.sum(axis=0), self.gradient.sum(axis=0), damping)

    def step(self, H: FloatArray, g: FloatArray, damping: float) -> FloatArray:
        """Return the step to the optimum of some recordings."""
        return -_solve(H, g, damping) if self.signs is None else -_signed(H, g, -self.signs, damping)

    def left_out(self, damping: float) -> FloatArray:
        """Return the square that the others' optimum leaves in each recording, shape (R,)."""
        H = self.information.sum(axis=0) - self.information
        g = self.gradient.sum(axis=0) - self.gradient
        steps = -_solve(H, g, damping)
        if self.signs is not None:
            for r in np.flatnonzero((steps * self.signs < 0.0).any(axis=1)):
                steps[r] = self.step(H[r], g[r], damping)
        own = np.einsum("ri,rij,rj->r", steps, self.score_information, steps)
        return np.asarray(self.square + 2.0 * np.sum(steps * self.score_gradient, axis=1) + own)


def gains(without: Normal, with_: Normal, damping: float) -> FloatArray:
    """Return the gain of predictive log-likelihood per recording, shape (R,)."""
    return np.asarray(0.5 * (without.left_out(damping) - with_.left_out(damping)))


def studentised(gain: FloatArray) -> FloatArray:
    """Return the mean of gains over its standard error, along the last axis."""
    n = gain.shape[-1]
    spread = np.std(gain, axis=-1, ddof=1) if n > 1 else np.full(gain.shape[:-1], np.inf)
    return np.asarray(np.mean(gain, axis=-1) / np.maximum(spread / np.sqrt(n), 1e-12))


def trimmed(gain: FloatArray) -> FloatArray:
    """Return the sum of gains along the last axis without the largest: what one recording alone shows is no property of a rig."""
    return np.asarray(gain.sum(axis=-1) - gain.max(axis=-1))


def _solve(H: FloatArray, g: FloatArray, damping: float) -> FloatArray:
    """Solve one or many systems, shapes (..., p, p) and (..., p), each scaled to a unit diagonal."""
    d = np.sqrt(np.maximum(np.diagonal(H, axis1=-2, axis2=-1), 1e-300))
    scaled = H / (d[..., :, None] * d[..., None, :]) + max(damping, 1e-10) * np.eye(d.shape[-1])
    return np.asarray(np.linalg.solve(scaled, (g / d)[..., None])[..., 0] / d)


def _signed(H: FloatArray, g: FloatArray, signs: FloatArray, damping: float) -> FloatArray:
    """Solve with signs asked for: non-negative least squares on a square root of the matrix, what is free split in two."""
    d = np.sqrt(np.maximum(np.diag(H), 1e-300))
    square, V = np.linalg.eigh(H / np.outer(d, d))
    root = np.sqrt(np.maximum(square, max(damping, 1e-9)))
    # any square root of the matrix serves
    factor = (V * root).T
    right = (V.T @ (g / d)) / root
    free = signs == 0.0
    turn = np.where(free, 1.0, signs)
    A = factor * turn
    x, _ = nnls(np.hstack([A, -A[:, free]]), right)
    found = x[: len(d)].copy()
    found[free] -= x[len(d) :]
    return np.asarray(turn * found / d)

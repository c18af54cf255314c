r"""Scores: by how much a candidate improves the prediction of experiments that its parameters were not estimated from.

Around an optimum the whitened residual of unit u (an experiment with its replicates) is :math:`e_u + J_u \Delta`. With
:math:`H_u = J_u^T J_u` and :math:`g_u = J_u^T e_u`, the others' optimum and the square that it leaves in u are

.. math::
   \Delta_{-u} = -\Bigl(\sum_{q \ne u} H_q\Bigr)^{-1} \sum_{q \ne u} g_q, \qquad
   S_u = e_u^T e_u + 2\,\Delta_{-u}^T g_u + \Delta_{-u}^T H_u \Delta_{-u} .

The gain of a candidate in u is that of predictive log-likelihood, half of S without it minus half of S with it.
If the others' optima are right, it is half the square of what the two predictions differ by, :math:`E_u`, give or take
:math:`\sqrt{2 E_u}`; if the effect is absent in u, it is :math:`-E_u`. The score of u lies between the two: an experiment says at
most that the effect is there as the others predict it, or that it is not.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls
from scipy.special import i0e, logsumexp

from flexdrive_gym.recording import FloatArray
from identification.mismatch.fitting.experiments import IntArray

# variances of random amplitudes that are tried, relative to what the noise leaves of one recording's amplitude
VARIANCES = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0, 3000.0)
# squares of an amplitude that all recordings share, relative to the same
SQUARES = tuple(2.0**k for k in range(13))


@dataclass(frozen=True, eq=False)
class Normal:
    """Normal equations of every unit.

    Attributes
    ----------
    information, gradient, square : ndarray, shapes (U, p, p), (U, p) and (U,)
        The gradient is that of half the square.
    signs : ndarray, shape (p,), or None
        Sign that a solution must have where it is not 0: a mass is positive. ``None`` where none is asked for.
    """

    information: FloatArray
    gradient: FloatArray
    square: FloatArray
    signs: FloatArray | None = None

    @classmethod
    def of(cls, products: FloatArray, signs: FloatArray | None = None) -> Normal:
        """Return the normal equations from products of columns whose last is the residual, shape (U, p + 1, p + 1)."""
        return cls(products[:, :-1, :-1], products[:, :-1, -1], products[:, -1, -1], signs)

    def solve(self, damping: float = 1e-10) -> FloatArray:
        """Return the step to the common optimum, shape (p,)."""
        return self.step(self.information.sum(axis=0), self.gradient.sum(axis=0), damping)

    def step(self, H: FloatArray, g: FloatArray, damping: float) -> FloatArray:
        """Return the step to the optimum of some units."""
        return -_solve(H, g, damping) if self.signs is None else -_signed(H, g, -self.signs, damping)

    def steps(self, damping: float) -> FloatArray:
        """Return the steps to the others' optimum, shape (U, p)."""
        H = self.information.sum(axis=0) - self.information
        g = self.gradient.sum(axis=0) - self.gradient
        steps = -_solve(H, g, damping)
        if self.signs is not None:
            for u in np.flatnonzero((steps * self.signs < 0.0).any(axis=1)):
                steps[u] = self.step(H[u], g[u], damping)
        return steps

    def left_out(self, damping: float) -> FloatArray:
        """Return the square that the others' optimum leaves in each unit, shape (U,)."""
        steps = self.steps(damping)
        own = np.einsum("ui,uij,uj->u", steps, self.information, steps)
        return np.asarray(self.square + 2.0 * np.sum(steps * self.gradient, axis=1) + own)


def gains(without: Normal, with_: Normal, damping: float) -> FloatArray:
    """Return the gain of predictive log-likelihood per unit, shape (U,)."""
    return np.asarray(0.5 * (without.left_out(damping) - with_.left_out(damping)))


def studentised(gain: FloatArray) -> FloatArray:
    """Return the mean of gains over its standard error, along the last axis."""
    n = gain.shape[-1]
    spread = np.std(gain, axis=-1, ddof=1) if n > 1 else np.full(gain.shape[:-1], np.inf)
    return np.asarray(np.mean(gain, axis=-1) / np.maximum(spread / np.sqrt(n), 1e-12))


def shared(gain: FloatArray) -> FloatArray:
    """Return the sum of gains along the last axis without the largest of them and without the largest loss.

    What one experiment alone shows is no property of a rig, and one that is odd does not speak against what the others show.
    """
    if gain.shape[-1] < 3:
        return np.asarray(gain.sum(axis=-1))
    return np.asarray(gain.sum(axis=-1) - np.maximum(gain.max(axis=-1), 0.0) - np.minimum(gain.min(axis=-1), 0.0))


def averaged(gain: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return the gains of the best of several, less what the choice among them makes by chance, and which one it is.

    An average of likelihood ratios is one, the largest of them is not (V. Vovk, R. Wang, Ann. Statist. 49, 2021). Of n that
    nothing is said of, one that stands out loses ln(n); where all gain alike there was no choice.

    Parameters
    ----------
    gain : ndarray, shape (U, n, data sets)

    Returns
    -------
    gain : ndarray, shape (U, data sets)
    best : ndarray of int, shape (data sets,)
    """
    total = shared(np.moveaxis(gain, 0, -1))
    best = np.argmax(total, axis=0)
    cost = total.max(axis=0) - logsumexp(total, axis=0) + np.log(len(total))
    return np.take_along_axis(gain, best[None, None], axis=1)[:, 0] - cost / len(gain), best


def bounded(gain: FloatArray, expected: FloatArray) -> FloatArray:
    """Return gains within what the others' optima let expect: of more an odd experiment speaks, and no property of a rig."""
    return np.clip(gain, -expected, expected)


def leave_one_out_variance(form: FloatArray, information: FloatArray, units: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return gains of pairs of random amplitudes, of a variance that is estimated from the other units.

    Parameters
    ----------
    form : ndarray, shape (R, P, data sets)
        Squares of the pairs' gradients.
    information : ndarray, shape (R, P)
        Of each of a pair, which do not correlate.
    units : ndarray of int, shape (R,)

    Returns
    -------
    gain : ndarray, shape (U, P, data sets)
        At most what amplitudes of that variance let expect.
    variance : ndarray, shape (P,)
        Most likely one in the first data set.
    """

    def each(variance: FloatArray) -> tuple[FloatArray, FloatArray]:
        lost = np.log1p(variance * information)
        gain = 0.5 * form / (information + 1.0 / variance)[..., None] - lost[..., None]
        return gain, np.minimum(gain, (variance * information - lost)[..., None])

    return _from_others(each, VARIANCES, information, units)


def leave_one_out_amplitude(
    form: FloatArray, information: FloatArray, units: IntArray
) -> tuple[FloatArray, FloatArray]:
    r"""Return gains of an amplitude that all recordings share, of any phase in each, estimated from the other units.

    With the gradient's square :math:`|g|^2` and the information h a recording has the likelihood ratio
    :math:`I_0(a |g|)\, e^{-a^2 h / 2}`, averaged over the phase.

    Parameters
    ----------
    form, information, units
        As those of :func:`leave_one_out_variance`.

    Returns
    -------
    gain : ndarray, shape (U, P, data sets)
        At most what that amplitude lets expect.
    amplitude : ndarray, shape (P,)
        Most likely one in the first data set.
    """
    size = np.sqrt(form)

    def each(square: FloatArray) -> tuple[FloatArray, FloatArray]:
        a = np.sqrt(square)
        x, half = a[:, None] * size, 0.5 * a**2 * information
        gain = np.log(i0e(x)) + x - half[..., None]
        return gain, bounded(gain, (np.log(i0e(2.0 * half)) + half)[..., None])

    gain, square = _from_others(each, SQUARES, information, units)
    return gain, np.sqrt(square)


def _from_others(
    each: Callable[[FloatArray], tuple[FloatArray, FloatArray]],
    grid: Sequence[float],
    information: FloatArray,
    units: IntArray,
) -> tuple[FloatArray, FloatArray]:
    """Return every unit's gains within what is expected, where the others put them, and the likeliest place of a grid.

    Parameters
    ----------
    each
        From a square of a pair's amplitudes, shape (P,), to the gains of all recordings, and these within what is expected,
        shapes (R, P, data sets).
    grid
        Squares, relative to what the noise leaves of one recording's amplitude.
    """
    typical = np.maximum(np.mean(information, axis=0), 1e-300)

    member = np.equal.outer(np.arange(int(units.max()) + 1), units).astype(np.float64)

    parts = [[np.tensordot(member, gain, axes=1) for gain in each(relative / typical)] for relative in grid]
    gain, within = (np.stack(found) for found in zip(*parts, strict=True))
    best = np.argmax(gain.sum(axis=1, keepdims=True) - gain, axis=0)
    likeliest = np.argmax(gain[..., 0].sum(axis=1), axis=0)
    return np.take_along_axis(within, best[None], axis=0)[0], np.asarray(grid)[likeliest] / typical


def scaled(H: FloatArray, damping: float, diagonal: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
    """Return one or many matrices, shape (..., p, p), scaled to a unit diagonal with a ridge, and the scale, shape (..., p).

    Parameters
    ----------
    diagonal : ndarray, shape (..., p)
        What is scaled to one; by default that of the matrices.
    """
    d = np.sqrt(np.maximum(np.diagonal(H, axis1=-2, axis2=-1) if diagonal is None else diagonal, 1e-300))
    return H / (d[..., :, None] * d[..., None, :]) + damping * np.eye(d.shape[-1]), d


def _solve(H: FloatArray, g: FloatArray, damping: float) -> FloatArray:
    """Solve one or many systems, shapes (..., p, p) and (..., p), each scaled to a unit diagonal."""
    A, d = scaled(H, max(damping, 1e-10))
    return np.asarray(np.linalg.solve(A, (g / d)[..., None])[..., 0] / d)


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

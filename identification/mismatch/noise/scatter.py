"""What null draws tell of the noise: rows and directions in which they scatter more widely than its linear model expects.

Noise acts on dry friction, whose response is not linear. What simulations of a drive tell as little as each other tells nothing
of physics that is left out, so it counts for less, in them and in the data alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from flexdrive_gym.recording import FloatArray
from identification.mismatch.fitting.bench import SingleArray
from identification.mismatch.noise.estimate import Noise, damped
from identification.mismatch.noise.nuisance import Direction

# time over which a scatter is smoothed: that of a slip [s]
_SLIP_S = 0.015
# innovation that one row of a normal data set of 40,000 reaches
_EDGE = 4.2
# eigenvalues of sensitivities' correlations under which a direction is one of others
_TOLD = 0.05


def scattered(noise: Noise, rows: SingleArray, left: FloatArray, found: Sequence[Direction]) -> Noise:
    """Return the noise with less weight on rows that are no normal noise.

    Near rest a little force decides whether a cart slips. Rows there are as far from each other in simulations of the
    same drive as they are from the data, and no candidate may gain from them. Nor may it from a blow: what is far outside of a
    normal distribution counts as if it were at its edge (P. J. Huber, Ann. Math. Statist. 35, 1964).

    Parameters
    ----------
    rows : ndarray, shape (N, draws)
        Raw rows of simulated data sets.
    left : ndarray, shape (N,)
        Raw rows without what all recordings share explains.
    """
    bench = noise.bench
    # innovations, with the variability that is damped later on: its directions are a sketch of how friction differs near rest
    square = np.mean(noise.innovations(rows, bench.pool.map) ** 2, axis=1)
    blows = (noise.white(left) / _EDGE) ** 2
    for p in bench.pieces:
        run = bench.runs[p.recording]
        near = 2 * int(0.5 * _SLIP_S / (run.block * run.sample_time)) + 1
        square[p.rows] = maximum_filter1d(uniform_filter1d(square[p.rows], near), near)
        square[p.rows] = np.maximum(square[p.rows], maximum_filter1d(blows[p.rows], near))
    return damped(replace(noise, weights=1.0 / np.sqrt(np.maximum(square, 1.0))), found)


def dispersed(noise: Noise, columns: SingleArray, draws: SingleArray) -> tuple[Noise, SingleArray]:
    r"""Return the noise that counts what its simulations tell for as much as they scatter, and their white rows.

    Near breakaway a small constant force decides how far a cart creeps, and linear noise knows nothing of that. Within what
    the parameters of the model and of candidates can change, simulated rows should have the covariance I. A direction whose
    variance :math:`\lambda` is larger than the largest eigenvalue that so many white draws would show (V. A. Marchenko,
    L. A. Pastur, 1967) is divided by :math:`\sqrt{\lambda}`: a score test with the covariance of its scores
    (V. P. Godambe, 1960).

    Parameters
    ----------
    columns : ndarray, shape (N, k)
        Whitened sensitivities.
    draws : ndarray, shape (N, draws)
        Whitened rows of simulated data sets.
    """
    white = draws.copy()

    def narrowed(r: int) -> SingleArray:
        """Take off what a recording's draws scatter too widely, and return its directions."""
        rows = noise.bench.rows[r]
        J = columns[rows].astype(np.float64)
        J = J / np.maximum(np.linalg.norm(J, axis=0), 1e-300)
        square, V = np.linalg.eigh(J.T @ J)
        told = square > _TOLD
        Q = J @ V[:, told] / np.sqrt(square[told])
        scores = Q.T @ draws[rows]
        variance, turn = np.linalg.eigh(scores @ scores.T / draws.shape[1])
        wide = variance > (1.0 + np.sqrt(len(variance) / draws.shape[1])) ** 2
        U = np.asarray(Q @ turn[:, wide] * np.sqrt(1.0 - 1.0 / np.sqrt(variance[wide])), dtype=np.float32)
        white[rows] -= U @ (U.T @ draws[rows].astype(np.float32, copy=False))
        return U

    return replace(noise, spread=list(noise.bench.pool.map(narrowed, range(len(noise.bench.rows))))), white

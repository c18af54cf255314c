r"""Output error beside run-to-run variability: what a free simulation misses that no friction of a single run makes.

Most of the output error is friction that differs from run to run, and next to it a parameter more is a coin's throw. With
levels :math:`s` of recordings and carts, and amplitudes :math:`a_r \sim N(0, S)` of everything that differs between runs
(:mod:`identification.mismatch.noise.nuisance`), rows are those of a linear mixed model,

.. math:: y_r = s^{-1} e_r, \qquad \operatorname{cov} y_r = I + D_r S D_r^T ,

and whitened by what the amplitudes leave of them (C. R. Henderson, Biometrics 31, 1975), as those of the prediction error are.
Unknown forces excuse nothing here: a simulation that drifts is far from the data.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexdrive_gym.recording import FloatArray
from identification.mismatch.fitting.bench import Bench, SingleArray
from identification.mismatch.fitting.fit import Metric
from identification.mismatch.fitting.levels import Levels
from identification.mismatch.noise.estimate import Noise, damped_modes
from identification.mismatch.noise.nuisance import Direction


@dataclass(frozen=True, eq=False)
class Marginal:
    """A metric for :func:`~identification.mismatch.fitting.fit.fit`.

    Attributes
    ----------
    bench
        Recordings.
    levels
        Of error of every recording and cart.
    modes : list of ndarray of float32, shape (rows of a recording, m)
        Directions that are damped, per recording.
    """

    bench: Bench
    levels: Levels
    modes: Sequence[SingleArray]

    def white(self, x: FloatArray) -> FloatArray:
        """Return whitened rows, shape (N,) or (N, k)."""
        y = self.levels.white(x)
        for rows, U in zip(self.bench.rows, self.modes, strict=True):
            y[rows] -= U @ (U.T @ y[rows].astype(np.float32))
        return y

    def left(self, raw: FloatArray) -> FloatArray:
        """Return raw rows without what differs from run to run, shape (N,)."""
        weights = self.levels.weights
        return np.asarray(self.white(raw) / np.where(weights > 0.0, weights, 1.0))


def marginal(bench: Bench, noise: Noise, found: Sequence[Direction], *raw: FloatArray) -> Metric:
    """Return the output error beside run-to-run variability, with the lowest levels that several residuals leave.

    Parameters
    ----------
    noise
        With the standard deviations of the variability.
    found
        The variability.
    raw
        Residuals, shape (N,).
    """
    levels = Levels.of(bench, *raw)
    if not found:
        return levels
    D = np.column_stack([d.change * d.size for d in found])
    # of prior size where nothing was estimated
    scale = {d.group: noise.scale.get(d.group, 1.0) for d in found}

    def beside(levels: Levels) -> Marginal:
        return Marginal(bench, levels, damped_modes(bench, levels.white(D), found, scale)[0])

    # of what is left: a recording whose friction is unlike that of others has no lower weight
    first = beside(levels)
    return beside(Levels.of(bench, *(first.left(e) for e in raw)))

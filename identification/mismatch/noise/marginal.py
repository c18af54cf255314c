r"""Output error beside run-to-run variability: what a free simulation misses that no friction of a single run makes.

Most of the output error is friction that differs from run to run, and next to it a parameter more is a coin's throw. With
levels :math:`s` of recordings and carts, and amplitudes :math:`a_r \sim N(0, S)` of everything that differs between runs
(:mod:`identification.mismatch.noise.nuisance`), rows are those of a linear mixed model,

.. math:: y_r = s^{-1} e_r, \qquad \operatorname{cov} y_r = I + \frac{h}{T} D_r S D_r^T ,

and whitened by what the amplitudes leave of them (C. R. Henderson, Biometrics 31, 1975), as those of the prediction error are.
Rows of an output error err alike for long: one in a time T, in which friction changes within a run, counts against the
amplitudes, not every step h (R. E. Chandler, S. Bate, Biometrika 94, 2007: the magnitude of a composite likelihood). As many
rows as there are would let the friction of runs answer for whatever makes a hundredth of a row's error smaller.
Unknown forces excuse nothing here: a simulation that drifts is far from the data.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexdrive_gym.recording import FloatArray
from identification.mismatch.fitting.bench import Bench, SingleArray
from identification.mismatch.fitting.levels import Levels
from identification.mismatch.noise.estimate import Noise, damped_modes
from identification.mismatch.noise.nuisance import KNOT_S, Direction


@dataclass(frozen=True, eq=False)
class Marginal:
    """A metric for :func:`~identification.mismatch.fitting.fit.fit`.

    Attributes
    ----------
    bench
        Recordings.
    levels
        Of error of every recording and cart.
    made : ndarray of float32, shape (N, k)
        What amplitudes of unit variance change of raw rows.
    modes : list of ndarray of float32, shape (rows of a recording, m)
        Directions that are damped, per recording.
    """

    bench: Bench
    levels: Levels
    made: SingleArray
    modes: Sequence[SingleArray]

    @classmethod
    def of(cls, bench: Bench, levels: Levels, made: SingleArray, found: Sequence[Direction]) -> Marginal:
        """Return the metric with its modes."""
        ones = {d.group: 1.0 for d in found}
        return cls(bench, levels, made, damped_modes(bench, levels.white(made), found, ones)[0])

    def white(self, x: FloatArray) -> FloatArray:
        """Return whitened rows, shape (N,) or (N, k)."""
        y = self.levels.white(x)
        for rows, U in zip(self.bench.rows, self.modes, strict=True):
            y[rows] -= U @ (U.T @ y[rows].astype(np.float32))
        return y

    def left(self, raw: FloatArray) -> FloatArray:
        """Return raw rows without the most probable amplitudes' share, shape (N,)."""
        y = self.levels.white(raw)
        for rows, U in zip(self.bench.rows, self.modes, strict=True):
            # a mode is damped by the root of what is left of its variance
            most = 2.0 - np.sum(U**2, axis=0)
            y[rows] -= U @ (most * (U.T @ y[rows].astype(np.float32)))
        weights = self.levels.weights
        return np.asarray(y / np.where(weights > 0.0, weights, 1.0))


def marginal(bench: Bench, noise: Noise, found: Sequence[Direction], *raw: FloatArray) -> Marginal:
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
    made = np.zeros((len(bench.valid), len(found)), np.float32)
    for i, d in enumerate(found):
        # of prior size where nothing was estimated
        made[:, i] = d.change * (d.size * noise.scale.get(d.group, 1.0))
    for rows, run in zip(bench.rows, bench.runs, strict=True):
        made[rows] *= np.sqrt(run.block * run.sample_time / KNOT_S)
    first = Marginal.of(bench, Levels.of(bench, *raw), made, found)
    # of what is left: a recording whose friction is unlike that of others has no lower weight
    return Marginal.of(bench, Levels.of(bench, *(first.left(e) for e in raw)), made, found)

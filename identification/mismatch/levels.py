"""Output error: rows weighted by the level of error of their recording and cart, which judge long horizons.

Names are selected by prediction errors, which tell laws apart within milliseconds. A drive that lacks something predicts well
with friction that simulates badly, so the drives that a diagnosis reports, and predicts from, are fitted once more by output
error.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexdrive_gym.recording import FloatArray
from identification.mismatch.bench import Bench
from identification.mismatch.fit import Fit, fit

# of weights: errors that levels are taken from are those of a fit with the levels before
_ROUNDS = 2


@dataclass(frozen=True, eq=False)
class Levels:
    """A metric for :func:`~identification.mismatch.fit.fit`.

    Attributes
    ----------
    weights : ndarray, shape (N,)
        Inverse levels; 0 where no sample is valid.
    """

    weights: FloatArray

    @classmethod
    def of(cls, bench: Bench, raw: FloatArray) -> Levels:
        """Return the levels that a residual shows, never below what encoder counts make."""
        weights = np.zeros(len(raw))
        for piece, floor in zip(bench.pieces, bench.floor, strict=True):
            e = raw[piece.rows][bench.valid[piece.rows]]
            variance = max(float(np.mean(e**2)), float(floor)) if len(e) else 1.0
            weights[piece.rows] = bench.valid[piece.rows] / np.sqrt(variance)
        return cls(weights)

    def white(self, x: FloatArray) -> FloatArray:
        """Return weighted rows, shape (N,) or (N, k)."""
        return np.asarray(x * (self.weights if x.ndim == 1 else self.weights[:, None]))


def output_error(bench: Bench, near: Fit) -> Fit:
    """Return the optimum of the output error from another optimum of the same parameters."""
    best = near
    for _ in range(_ROUNDS):
        best = fit(bench, Levels.of(bench, best.residual), best.values, best.names)
    return best

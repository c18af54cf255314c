"""Output error as a metric: rows weighted by the level of error of their recording and cart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexdrive_gym.recording import FloatArray
from identification.mismatch.fitting.bench import Bench


@dataclass(frozen=True, eq=False)
class Levels:
    """A metric for :func:`~identification.mismatch.fitting.fit.fit`.

    Attributes
    ----------
    weights : ndarray, shape (N,)
        Inverse levels; 0 where no sample is valid.
    """

    weights: FloatArray

    @classmethod
    def of(cls, bench: Bench, *raw: FloatArray) -> Levels:
        """Return the lowest levels that any of several residuals shows, never below what encoder counts make.

        A recording that a model describes badly counts for it as much as for one that describes it better.
        """
        weights = np.zeros(len(bench.valid))
        for piece, floor in zip(bench.pieces, bench.floor, strict=True):
            own = bench.valid[piece.rows]
            lowest = min(float(np.mean(e[piece.rows][own] ** 2)) for e in raw) if own.any() else 1.0
            variance = max(lowest, float(floor))
            weights[piece.rows] = bench.valid[piece.rows] / np.sqrt(variance)
        return cls(weights)

    def white(self, x: FloatArray) -> FloatArray:
        """Return weighted rows, shape (N,) or (N, k)."""
        return np.asarray(x * (self.weights if x.ndim == 1 else self.weights[:, None]))

"""Amplitudes that the rows of recordings tell: of what differs between runs, and of what all of them share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from flexdrive_gym.recording import FloatArray
from identification.mismatch.fitting.bench import Bench, SingleArray
from identification.mismatch.fitting.score import scaled
from identification.mismatch.noise.nuisance import Direction
from identification.replay.lanes import Across

# ridge relative to the diagonal of the information: what single precision does not resolve
_RIDGE = 1e-9


@dataclass(frozen=True, eq=False)
class Told:
    """Amplitudes of run-to-run variability, and of what all recordings share, as rows whitened by the filter tell them.

    Attributes
    ----------
    directions : ndarray of float32, shape (N, k)
        Whitened by the filter.
    products : ndarray, shape (R, k + m + 1, k + m + 1)
        Of directions, common changes and the residual in every recording.
    amplitude, variance : ndarray, shape (R, k)
        Most probable amplitudes relative to the prior, and their variances.
    common : ndarray, shape (m,)
        By how much what all recordings share is to be taken off the residual.
    """

    directions: SingleArray
    products: FloatArray
    amplitude: FloatArray
    variance: FloatArray
    common: FloatArray

    @classmethod
    def of(
        cls,
        white: SingleArray,
        rows: Sequence[slice],
        found: Sequence[Direction],
        scale: Mapping[str, float],
        across: Across = map,
    ) -> Told:
        """Tell amplitudes of standard deviations that are ``scale`` times the prior ones.

        Parameters
        ----------
        white : ndarray of float32, shape (N, k + m + 1)
            Directions of prior size, common changes, and the residual, whitened by the filter.
        rows
            Of every recording.
        """

        def product(r: int) -> FloatArray:
            own = white[rows[r]].astype(np.float64)
            return np.asarray(own.T @ own)

        products = np.array(list(across(product, range(len(rows)))))
        none = np.empty(0)
        # hundreds of common changes are needed no more
        return cls(white[:, : len(found)].copy(), products, none, none, none).with_scale(found, scale)

    def with_scale(self, found: Sequence[Direction], scale: Mapping[str, float]) -> Told:
        """Return the amplitudes for other standard deviations, by Henderson's equations (C. R. Henderson, 1975)."""
        k = len(found)
        prior = np.diag([scale[d.group] ** -2.0 for d in found])
        covariance = inverse(self.products[:, :k, :k] + prior)
        # of common changes and the residual: the amplitudes that they alone would have, and what these leave
        own = covariance @ self.products[:, :k, k:]
        rest = np.sum(self.products[:, k:, k:] - self.products[:, k:, :k] @ own, axis=0)
        variance = np.diagonal(covariance, axis1=1, axis2=2)
        if rest.shape[0] == 1:
            return replace(self, amplitude=own[..., -1], variance=variance, common=np.empty(0))
        whole = np.sum(self.products, axis=0).diagonal()[k:-1] + 1.0
        spread = inverse(rest[:-1, :-1] + np.eye(len(rest) - 1), whole)
        common = spread @ rest[:-1, -1]
        shared = own[..., :-1]
        return replace(
            self,
            amplitude=own[..., -1] - shared @ common,
            variance=variance + np.sum(shared @ spread * shared, axis=-1),
            common=common,
        )

    def left(self, bench: Bench, D: SingleArray, common: SingleArray, residual: FloatArray) -> FloatArray:
        """Return the raw residual without amplitudes and what all recordings share, shape (N,)."""
        own = np.concatenate([D[rows] @ a.astype(D.dtype) for rows, a in zip(bench.rows, self.amplitude, strict=True)])
        return np.asarray(residual - own - common @ self.common.astype(common.dtype))


def inverse(information: FloatArray, whole: FloatArray | None = None) -> FloatArray:
    """Return the inverse of one or many matrices, shape (..., p, p), each scaled to a unit diagonal.

    Around a drive whose second cart hardly holds, changes are millions of standard deviations, and products of such columns hide
    the others by round-off.

    Parameters
    ----------
    whole : ndarray, shape (p,)
        Diagonal before something was taken off; by default that of the matrices.
    """
    A, d = scaled(information, _RIDGE, whole)
    return np.asarray(np.linalg.inv(A) / (d[..., :, None] * d[..., None, :]))


def scales(mean: FloatArray, variance: FloatArray, found: Sequence[Direction]) -> dict[str, float]:
    """Return the groups' standard deviations, one step of expectation maximisation; what all recordings share is physics."""
    own = np.var(mean, axis=0) + variance.mean(axis=0)
    groups = sorted({d.group for d in found})
    square = {g: float(np.mean([o for o, d in zip(own, found, strict=True) if d.group == g])) for g in groups}
    limits = {d.group: (d.least, d.most) for d in found}
    return {g: float(np.clip(np.sqrt(s), *limits[g])) for g, s in square.items()}

r"""Screening: how much of the error could each candidate explain, and how much would chance?

With :math:`S` a candidate's sensitivities and :math:`J` those of the present model, both made comparable by the
:mod:`workbench <identification.mismatch.workbench>`, the gain of the candidate is the share of the remaining error in the
part of :math:`S` that a refit of the present model cannot hide:

.. math:: g = \frac{\|Q^T \varepsilon\|^2}{\|\varepsilon\|^2}, \qquad Q = \operatorname{orth}\left((I - J J^+) S\right).

What chance reaches is told by :mod:`chance <identification.mismatch.chance>`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexdrive_gym.drive.effects import LAYOUT
from flexdrive_gym.recording import FloatArray
from identification.mismatch.candidates import Candidate, switch
from identification.mismatch.workbench import Workbench

_SMALLEST = 1e-3


@dataclass(frozen=True, eq=False)
class Screened:
    """A candidate and what it could explain.

    Attributes
    ----------
    gain
        Share of the remaining squared error.
    sizes
        Linear estimate of each size, in its unit.
    hidden
        Share of the effect that a refit of the present model hides.
    basis
        Orthonormal columns of the candidate beyond the present model, shape (N, k).
    """

    candidate: Candidate
    gain: float
    sizes: tuple[float, ...]
    hidden: float
    basis: FloatArray


def orthonormal(columns: FloatArray) -> FloatArray:
    """Return an orthonormal basis of the columns, leaving out what is (nearly) dependent."""
    scale = np.linalg.norm(columns, axis=0)
    use = scale > 0.0
    if not use.any():
        return np.zeros((len(columns), 0))
    U, s, _ = np.linalg.svd(columns[:, use] / scale[use], full_matrices=False)
    return np.asarray(U[:, s > 1e-6 * s[0]])


def screen(
    bench: Workbench, candidate: Candidate, columns: FloatArray, residual: FloatArray, present: FloatArray
) -> Screened:
    """Judge one candidate.

    Parameters
    ----------
    columns
        Change of the comparable residual when each size goes from null to its start value, shape (N, sizes).
    residual
        Comparable residual without the present model's directions, shape (N,).
    present
        Orthonormal basis of the present model's directions, shape (N, m).
    """
    nothing = Screened(candidate, 0.0, tuple(0.0 for _ in candidate.sizes), 1.0, np.zeros((len(residual), 0)))
    total = float(np.sum(columns**2))
    if not total > 0.0:
        return nothing
    beyond = columns - present @ (present.T @ columns)
    hidden = 1.0 - float(np.sum(beyond**2)) / total
    if hidden > 1.0 - _SMALLEST:
        return nothing
    if bench.unplaced(candidate.period):
        return _screen_each_run(bench, candidate, beyond, residual, hidden)
    amplitude, *_ = np.linalg.lstsq(beyond, -residual, rcond=1e-6)
    use = ~(np.array([_one_sided(key) for key, _ in candidate.sizes]) & (amplitude <= 0.0))
    if not use.any():
        return nothing
    if not use.all():
        beyond = beyond[:, use]
        part, *_ = np.linalg.lstsq(beyond, -residual, rcond=1e-6)
        amplitude = np.zeros(len(use))
        amplitude[use] = part
    basis = orthonormal(beyond)
    gain = float(np.sum((basis.T @ residual) ** 2) / (residual @ residual))
    sizes = tuple(
        start if _switch(key) else float(a * start) for (key, start), a in zip(candidate.sizes, amplitude, strict=True)
    )
    return Screened(candidate, gain, sizes, hidden, basis)


def _one_sided(key: str) -> bool:
    q = LAYOUT[key].parameter
    return q.lower >= q.null or _switch(key)


def _switch(key: str) -> bool:
    return switch(LAYOUT[key].parameter, LAYOUT[key].effect)


def _screen_each_run(
    bench: Workbench, candidate: Candidate, beyond: FloatArray, residual: FloatArray, hidden: float
) -> Screened:
    """Judge an effect of position: every run began somewhere else, so each has amplitudes of its own."""
    basis = np.zeros_like(beyond)
    gained = np.zeros(len(bench.runs))
    squares = np.zeros(len(candidate.sizes))
    for r in range(len(bench.runs)):
        rows = bench.rows.of(r)
        own = orthonormal(beyond[rows])
        basis[rows, : own.shape[1]] = own
        gained[r] = float(np.sum((own.T @ residual[rows]) ** 2))
        amplitude, *_ = np.linalg.lstsq(beyond[rows], -residual[rows], rcond=1e-3)
        squares += gained[r] * amplitude**2
    size = np.sqrt(squares / max(float(gained.sum()), 1e-300))
    sizes = tuple(float(a * start) for (_, start), a in zip(candidate.sizes, size, strict=True))
    return Screened(candidate, float(gained.sum() / (residual @ residual)), sizes, hidden, basis)

r"""Screening: how much of the error could each candidate explain, and how much would chance?

With :math:`S` a candidate's sensitivities and :math:`J` those of the present model, both made comparable by the
:mod:`workbench <identification.mismatch.workbench>`, the gain of the candidate is the share of the remaining error in the
part of :math:`S` that a refit of the present model cannot hide:

.. math:: g = \frac{\|Q^T \varepsilon\|^2}{\|\varepsilon\|^2}, \qquad Q = \operatorname{orth}\left((I - J J^+) S\right).

What chance reaches is told by :mod:`chance <identification.mismatch.chance>`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from flexdrive_gym.drive.effects import LAYOUT
from flexdrive_gym.recording import FloatArray
from identification.mismatch.candidates import Candidate, switch
from identification.mismatch.workbench import Columns, Workbench

_SMALLEST = 1e-3
# candidates whose columns are held side by side
_TOGETHER = 32


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
    waves
        Sine and cosine of an effect that repeats along the track, beyond the present model and ``basis``, shape (N, 2) or
        (N, 0): every run has its own phase, but all have one amplitude.
    """

    candidate: Candidate
    gain: float
    sizes: tuple[float, ...]
    hidden: float
    basis: Columns
    waves: Columns

    def explains(self, bench: Workbench, residual: FloatArray) -> FloatArray:
        r"""Return how much of the square of residuals, shape (N,) or (N, draws), it explains, shape () or (draws,).

        With one amplitude and the best phase in every run r that is, with :math:`W` the waves,
        :math:`(\sum_r |W_r^T \varepsilon_r|)^2 / \sum_r \tfrac12 \|W_r\|^2`.
        """
        return explained(bench, [self], residual)[0]


def explained(bench: Workbench, screened: Sequence[Screened], residual: FloatArray | Columns) -> list[FloatArray]:
    """Return what :meth:`Screened.explains` does for each of many candidates: residuals are read once for all of them."""
    found: list[FloatArray] = []
    for begin in range(0, len(screened), _TOGETHER):
        some = screened[begin : begin + _TOGETHER]
        columns = np.hstack([half for s in some for half in (s.basis, s.waves)])
        together: FloatArray = np.zeros((columns.shape[1], *residual.shape[1:]))
        lengths = np.zeros((len(some), *residual.shape[1:]))
        edges = np.cumsum([0, *(n for s in some for n in (s.basis.shape[1], s.waves.shape[1]))])
        waves = [slice(edges[2 * i + 1], edges[2 * i + 2]) for i in range(len(some))]
        for r in range(len(bench.runs)):
            rows = bench.rows.of(r)
            part = columns[rows].T @ residual[rows]
            together += part
            squares = np.square(part, dtype=np.float64)
            for i, own in enumerate(waves):
                if own.stop > own.start:
                    lengths[i] += np.sqrt(squares[own].sum(axis=0))
        for i, s in enumerate(some):
            basis = together[edges[2 * i] : edges[2 * i + 1]]
            power = max(0.5 * float(np.sum(np.square(s.waves, dtype=np.float64))), 1e-300)
            found.append(np.asarray(np.sum(basis**2, axis=0) + lengths[i] ** 2 / power))
    return found


def orthonormal(columns: FloatArray) -> FloatArray:
    """Return an orthonormal basis of the columns, leaving out what is (nearly) dependent."""
    scale = np.linalg.norm(columns, axis=0)
    use = scale > 0.0
    if not use.any():
        return np.zeros((len(columns), 0))
    # of a tall matrix the small factor has the singular values
    Q, R = np.linalg.qr(columns[:, use] / scale[use])
    U, s, _ = np.linalg.svd(R)
    return np.asarray(Q @ U[:, s > 1e-6 * s[0]])


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
    nothing = Screened(candidate, 0.0, tuple(0.0 for _ in candidate.sizes), 1.0, *_nothing(len(residual), 2))
    total = float(np.sum(columns**2))
    if not total > 0.0:
        return nothing
    beyond = columns - present @ (present.T @ columns)
    hidden = 1.0 - float(np.sum(beyond**2)) / total
    if hidden > 1.0 - _SMALLEST:
        return nothing
    if bench.unplaced(candidate.period):
        return _screen_waves(bench, candidate, beyond, residual, hidden)
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
    return Screened(candidate, gain, sizes, hidden, basis.astype(np.float32), *_nothing(len(residual), 1))


def _nothing(n: int, times: int) -> list[Columns]:
    return [np.zeros((n, 0), dtype=np.float32) for _ in range(times)]


def _one_sided(key: str) -> bool:
    q = LAYOUT[key].parameter
    return q.lower >= q.null or _switch(key)


def _switch(key: str) -> bool:
    return switch(LAYOUT[key].parameter, LAYOUT[key].effect)


def _screen_waves(
    bench: Workbench, candidate: Candidate, beyond: FloatArray, residual: FloatArray, hidden: float
) -> Screened:
    """Judge an effect that repeats along the track: every run began somewhere else, but the amplitude is that of the rig."""
    repeats = np.array([key.endswith(("a_sin", "a_cos")) for key, _ in candidate.sizes])
    basis = orthonormal(beyond[:, ~repeats]) if not repeats.all() else beyond[:, :0]
    waves = beyond[:, repeats] - basis @ (basis.T @ beyond[:, repeats])
    found = Screened(candidate, 0.0, (), hidden, basis.astype(np.float32), waves.astype(np.float32))
    rows = [bench.rows.of(r) for r in range(len(bench.runs))]
    along = sum(float(np.linalg.norm(waves[i].T @ residual[i])) for i in rows)
    amplitude = along / max(0.5 * float(np.sum(waves**2)), 1e-300)
    rest, *_ = np.linalg.lstsq(beyond[:, ~repeats], -residual, rcond=1e-6)
    # as a sine in every run; where it begins is found later
    shares = iter((amplitude, 0.0))
    others = iter(rest)
    sizes = tuple(
        float(next(shares if wave else others)) * start
        for wave, (_, start) in zip(repeats, candidate.sizes, strict=True)
    )
    gain = float(found.explains(bench, residual) / (residual @ residual))
    return replace(found, gain=gain, sizes=sizes)

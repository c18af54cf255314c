"""Every candidate's gain in data and in null draws alike."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexdrive_gym.recording import FloatArray
from identification.diagnosis.linear import Entry, Linear
from identification.diagnosis.score import trimmed

Name = tuple[str, str]
# variances of random amplitudes that are tried, relative to what the noise leaves of one recording's amplitude
_VARIANCES = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0, 3000.0)


@dataclass(frozen=True, eq=False)
class Table:
    """Gains of every name in several data sets.

    Attributes
    ----------
    total, rest
        Name to gains over all units, and over all but the one that gains most, ndarray, shape (data sets,): of its best entry.
    entry
        Name to the best entry's number and its gain per unit, in the first data set.
    variance
        Number of an entry to the variance of its random amplitudes, in the first data set.
    """

    total: dict[Name, FloatArray]
    rest: dict[Name, FloatArray]
    entry: dict[Name, tuple[int, FloatArray]]
    variance: dict[int, float]


def evaluate(linear: Linear, residual: FloatArray) -> Table:
    """Return every candidate's gain.

    Parameters
    ----------
    residual : ndarray, shape (N, data sets)
        Whitened rows.
    """
    damping = linear.bench.settings.damping
    g, square = linear.gradient(residual), linear.square(residual)
    base, steps = _left_out(linear, linear.base, g, square, damping)
    table = Table({}, {}, {}, {})
    random = [i for i, e in enumerate(linear.entries) if e.random]
    for i, entry in enumerate(linear.entries):
        if not entry.random:
            left, _ = _left_out(linear, [*linear.base, *entry.columns], g, square, damping)
            _take(table, i, entry.candidate.name, 0.5 * (base - left))
    for i, (gain, variance) in zip(
        random, _random(linear, residual, steps, [linear.entries[i] for i in random]), strict=True
    ):
        table.variance[i] = variance
        _take(table, i, linear.entries[i].candidate.name, gain)
    return table


def _take(table: Table, i: int, name: Name, gain: FloatArray) -> None:
    """Keep the better one of a name's entries in every data set; ``gain`` has the shape (U, data sets)."""
    total, rest = gain.sum(axis=0), trimmed(gain.T)
    if name in table.total:
        better = total > table.total[name]
        if better[0]:
            table.entry[name] = i, gain[:, 0]
        table.total[name] = np.where(better, total, table.total[name])
        table.rest[name] = np.where(better, rest, table.rest[name])
    else:
        table.total[name], table.rest[name], table.entry[name] = total, rest, (i, gain[:, 0])


def _left_out(
    linear: Linear, columns: Sequence[int], g: FloatArray, square: FloatArray, damping: float
) -> tuple[FloatArray, FloatArray]:
    """Return what the others' optimum leaves, shape (U, data sets), and the steps to it, shape (U, p, data sets)."""
    use = list(columns)
    H = linear.products[:, use][:, :, use]
    own = g[:, use]
    A = H.sum(axis=0) - H
    d = np.sqrt(np.maximum(np.einsum("uii->ui", A), 1e-300))
    scaled = A / (d[:, :, None] * d[:, None, :]) + damping * np.eye(len(use))
    others = (own.sum(axis=0) - own) / d[..., None]
    steps = -np.linalg.solve(scaled, others) / d[..., None]
    return square + 2.0 * np.sum(steps * own, axis=1) + np.sum(steps * (H @ steps), axis=1), steps


def _random(
    linear: Linear, residual: FloatArray, steps: FloatArray, entries: Sequence[Entry]
) -> list[tuple[FloatArray, float]]:
    """Return the gains of effects whose amplitudes differ from run to run, and the variance of these."""
    if not entries:
        return []
    bench = linear.bench
    use = [c for e in entries for c in e.columns]
    base = list(linear.base)
    U, sets = len(linear.products), residual.shape[1]
    H, g = [], []
    for rows, u in zip(bench.rows, bench.units, strict=True):
        S = linear.white[rows][:, use]
        own = S.T @ residual[rows] + (S.T @ linear.white[rows][:, base]) @ steps[u]
        pairs = S.reshape(len(S), len(entries), 2)
        H.append(np.einsum("npi,npj->pij", pairs, pairs))
        g.append(own.reshape(len(entries), 2, sets))
    H_, g_ = np.array(H), np.array(g)  # (R, P, 2, 2) and (R, P, 2, sets)
    typical = np.maximum(0.5 * np.einsum("rpii->rp", H_).mean(axis=0), 1e-300)
    found = []
    gain = np.zeros((len(_VARIANCES), len(entries), U, sets))
    for v, relative in enumerate(_VARIANCES):
        precision = typical / relative
        M = H_ + precision[None, :, None, None] * np.eye(2)
        determinant = M[..., 0, 0] * M[..., 1, 1] - M[..., 0, 1] ** 2
        a, b = g_[:, :, 0], g_[:, :, 1]
        form = (M[..., 1, 1, None] * a**2 - 2.0 * M[..., 0, 1, None] * a * b + M[..., 0, 0, None] * b**2) / determinant[
            ..., None
        ]
        each = 0.5 * form - 0.5 * np.log(determinant / precision**2)[..., None]
        for r, u in enumerate(bench.units):
            gain[v, :, u] += each[r]
    for p in range(len(entries)):
        own = gain[:, p]
        best = np.argmax(own.sum(axis=1, keepdims=True) - own, axis=0)
        chosen = np.take_along_axis(own, best[None], axis=0)[0]
        most = int(np.argmax(own[:, :, 0].sum(axis=1)))
        found.append((chosen, float(_VARIANCES[most] / typical[p])))
    return found

"""Every candidate's gain in data and in null draws alike."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from flexdrive_gym.recording import FloatArray
from identification.mismatch.candidates.catalogue import Candidate
from identification.mismatch.candidates.free import Shape
from identification.mismatch.candidates.narrow_band import Line, lines
from identification.mismatch.candidates.phases import Phase
from identification.mismatch.fitting.bench import Bench, Columns
from identification.mismatch.fitting.score import averaged, bounded, leave_one_out_amplitude, scaled, shared
from identification.mismatch.selection.linear import Entry, Linear

Name = tuple[str, str]


@dataclass(frozen=True, eq=False)
class Best:
    """The best of a name's entries in the first data set.

    Attributes
    ----------
    candidate, columns
        What it is, and its columns of the sensitivities.
    gain : ndarray, shape (U,)
        Per unit.
    variance
        Of the sine and the cosine of a ripple; ``None`` where all recordings share one change.
    """

    candidate: Candidate | Shape | Phase | Line
    columns: tuple[int, ...]
    gain: FloatArray
    variance: float | None = None


@dataclass(frozen=True, eq=False)
class Table:
    """Gains of every name in several data sets.

    Attributes
    ----------
    total
        Name to the gain of its best entry, of a ripple to that of the average period, ndarray, shape (data sets,).
    best
        Name to its best entry in the first data set.
    entries
        Name to all its entries, with their gains in the first data set.
    """

    total: dict[Name, FloatArray]
    best: dict[Name, Best]
    entries: dict[Name, list[tuple[float, Best]]]

    def take(self, entry: Best, gain: FloatArray) -> None:
        """Keep the better one of a name's entries in every data set; ``gain`` has the shape (U, data sets)."""
        total = shared(gain.T)
        self.entries.setdefault(entry.candidate.name, []).append((float(total[0]), entry))
        self._keep(entry, total)

    def take_average(self, entries: Sequence[Best], gain: FloatArray) -> None:
        """Keep the best of a name's entries with what their average gains; ``gain`` has the shape (U, entries, data sets)."""
        own, best = averaged(gain)
        totals = shared(gain[..., 0].T)
        self.entries.setdefault(entries[0].candidate.name, []).extend(
            (float(t), e) for t, e in zip(totals, entries, strict=True)
        )
        self._keep(replace(entries[best[0]], gain=own[:, 0]), shared(own.T))

    def _keep(self, entry: Best, total: FloatArray) -> None:
        name = entry.candidate.name
        if name not in self.total:
            self.total[name], self.best[name] = total, entry
            return
        better = total > self.total[name]
        if better[0]:
            self.best[name] = entry
        self.total[name] = np.where(better, total, self.total[name])


def evaluate(linear: Linear, residual: Columns) -> Table:
    """Return every candidate's gain.

    Parameters
    ----------
    residual : ndarray, shape (N, data sets)
        Whitened rows.
    """
    damping = linear.bench.settings.damping
    g, square = linear.gradient(residual), linear.square(residual)
    base, steps = _left_out(linear, linear.base, g, square, damping)
    table = Table({}, {}, {})
    for entry in linear.entries:
        if not entry.random:
            use = [*linear.base, *entry.columns]
            left, with_ = _left_out(linear, use, g, square, damping)
            # what the two predictions differ by
            apart = with_.copy()
            apart[:, : len(linear.base)] -= steps
            H = linear.products[:, use][:, :, use]
            gain = bounded(0.5 * (base - left), 0.5 * np.sum(apart * (H @ apart), axis=1))
            table.take(Best(entry.candidate, entry.columns, gain[:, 0]), gain)
    rest = _others(linear, residual, steps)
    random = [e for e in linear.entries if e.random]
    names: dict[Name, list[tuple[Best, FloatArray]]] = {}
    for entry, (gain, variance) in zip(random, _random(linear, rest, random), strict=True):
        own = Best(entry.candidate, entry.columns, gain[:, 0], variance)
        names.setdefault(entry.candidate.name, []).append((own, gain))
    for found in names.values():
        table.take_average([best for best, _ in found], np.stack([gain for _, gain in found], axis=1))
    for line, gain in lines(linear.bench, rest):
        table.take(Best(line, (), gain[:, 0]), gain)
    return table


def _left_out(
    linear: Linear, columns: Sequence[int], g: FloatArray, square: FloatArray, damping: float
) -> tuple[FloatArray, FloatArray]:
    """Return what the others' optimum leaves, shape (U, data sets), and the steps to it, shape (U, p, data sets)."""
    use = list(columns)
    H = linear.products[:, use][:, :, use]
    own = g[:, use]
    A, d = scaled(H.sum(axis=0) - H, damping)
    others = (own.sum(axis=0) - own) / d[..., None]
    steps = -np.linalg.solve(A, others) / d[..., None]
    return square + 2.0 * np.sum(steps * own, axis=1) + np.sum(steps * (H @ steps), axis=1), steps


def _others(linear: Linear, residual: Columns, steps: FloatArray) -> Columns:
    """Return the whitened rows that the base model fitted to the other units leaves, shape (N, data sets)."""
    rest = residual.copy()
    base = list(linear.base)
    for rows, u in zip(linear.bench.rows, linear.bench.units, strict=True):
        rest[rows] += linear.white[rows][:, base] @ steps[u]
    return rest


def _random(linear: Linear, rest: Columns, entries: Sequence[Entry]) -> list[tuple[FloatArray, float]]:
    """Return the gains of effects whose phase differs from run to run, and the variances of their sines and cosines."""
    if not entries:
        return []
    return random_gains(linear.bench, linear.white[:, [c for e in entries for c in e.columns]], rest)


def random_gains(bench: Bench, columns: Columns, rest: Columns) -> list[tuple[FloatArray, float]]:
    """Return the gains of pairs of columns with one amplitude and a phase of every run, and the variances of either.

    Parameters
    ----------
    columns : ndarray, shape (N, 2 P)
        Whitened, two of every pair.
    rest : ndarray, shape (N, data sets)
        Whitened rows that the others' optimum leaves.
    """
    pairs = columns.shape[1] // 2
    information, form = [], []
    for rows in bench.rows:
        S = columns[rows].reshape(-1, pairs, 2).astype(np.float64)
        H = np.einsum("npi,npj->pij", S, S)
        g = np.tensordot(S, rest[rows], axes=(0, 0))
        # turned until sine and cosine do not correlate, and scaled to one information
        square, turn = np.linalg.eigh(H)
        own = np.sqrt(np.maximum(square.prod(axis=1), 0.0))
        ratio = np.sqrt(own[:, None] / np.maximum(square, 1e-12 * square.max() + 1e-300))
        turned = np.einsum("pij,pis->pjs", turn, g) * ratio[..., None]
        information.append(own)
        form.append(np.sum(turned**2, axis=1))
    gain, amplitude = leave_one_out_amplitude(np.array(form), np.array(information), bench.units)
    # of a sine and a cosine each
    return [(gain[:, p], 0.5 * float(amplitude[p]) ** 2) for p in range(pairs)]

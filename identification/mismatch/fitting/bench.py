"""Recordings of one drive as rows of residuals: simulated in batches, compared by velocity or, if motion is small, position."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from flexdrive_gym.drive.effects import LAYOUT
from flexdrive_gym.recording import BoolArray, FloatArray, Recording
from identification.mismatch.fitting.experiments import IntArray, experiments
from identification.mismatch.fitting.scale import Scale
from identification.mismatch.fitting.thread_pool import ThreadPool
from identification.mismatch.settings import Settings
from identification.replay.batch import RunBatch
from identification.replay.lanes import Across
from identification.replay.output_error import Run, prepare

Values = Mapping[str, float]
SingleArray = NDArray[np.float32]
# of single precision where there are hundreds of them
Columns = FloatArray | SingleArray
Rows = TypeVar("Rows", FloatArray, SingleArray)
# a cart that has moved by no more than a count, or so much of its way, within this time rests [s, 1]
_REST_S, _STILL = 0.025, 1e-4


@dataclass(frozen=True, eq=False)
class Piece:
    """Rows of one cart in one recording.

    Attributes
    ----------
    recording, cart
        Numbers from 0.
    rows
        Where they are.
    """

    recording: int
    cart: int
    rows: slice


class Bench:
    """Recordings of one drive, and the residuals of any drive against them.

    Rows are block means of measured minus simulated motion, 5 ms long, or 10 ms where there would be very many: velocities
    [mm/s], or positions [mm] in recordings whose motion is so small that a velocity would be rounding. Recordings compared by
    velocity come first.

    Parameters
    ----------
    recordings
        Of one drive.
    pool
        Simulates several drives at once.
    settings
        Constants.
    """

    def __init__(self, recordings: Sequence[Recording], pool: ThreadPool, settings: Settings) -> None:
        prepared = in_rows([comparable(r, settings) for r in recordings], settings)
        order = sorted(range(len(prepared)), key=lambda i: prepared[i].positions)
        self.recordings = [recordings[i] for i in order]
        self.runs = [prepared[i] for i in order]
        self.pool, self.settings = pool, settings
        self._batches, first = [], 0
        for positions in (False, True):
            runs = [free(run) for run in self.runs if run.positions == positions]
            if runs:
                self._batches.append((slice(first, first + len(runs)), RunBatch(runs)))
                first += len(runs)
        self.pieces, self.valid = _layout(self.runs)
        self.rows = [
            slice(mine[0].rows.start, mine[-1].rows.stop)
            for r in range(len(self.runs))
            for mine in [[p for p in self.pieces if p.recording == r]]
        ]

    @cached_property
    def units(self) -> IntArray:
        """Return the unit of validation of every recording, shape (R,): recordings of one experiment err alike."""
        return experiments(self.recordings)

    def products(self, white: Columns, others: Columns | None = None, across: Across = map) -> FloatArray:
        """Return the products of whitened columns, shape (N, k), with others, by default with themselves, shape (U, k, m).

        They are of double precision, whatever the columns are of.

        Parameters
        ----------
        across
            Maps over units: ``map``, or that of the pool where its threads are free.
        """
        found = np.zeros((int(self.units.max()) + 1, white.shape[1], (white if others is None else others).shape[1]))

        def add(u: int) -> None:
            for r in np.flatnonzero(self.units == u):
                own = np.asarray(white[self.rows[r]], dtype=np.float64)
                found[u] += own.T @ (own if others is None else others[self.rows[r]])

        list(across(add, range(len(found))))
        return found

    def sums(self, columns: FloatArray) -> FloatArray:
        """Return the sums of columns, shape (N, k), over the rows of every unit, shape (U, k)."""
        found = np.zeros((int(self.units.max()) + 1, columns.shape[1]))
        for rows, u in zip(self.rows, self.units, strict=True):
            found[u] += columns[rows].sum(axis=0)
        return found

    @property
    def carts(self) -> int:
        """How many carts are simulated."""
        return len(self.runs[0].measured)

    @cached_property
    def scale(self) -> Scale:
        """Return how large commands and motions are beside those of the handout's experiments."""
        return Scale.of(self.runs)

    @cached_property
    def bounds(self) -> dict[str, tuple[float, float]]:
        """Return tighter bounds than the catalogue's: a wave longer than the way travelled cannot be told from a spring."""
        found = {}
        for key, slot in LAYOUT.items():
            if slot.parameter.name == "P":
                c = 1 if slot.where in {"cart_2", "encoder_2"} and self.carts == 2 else 0
                way = max(float(np.ptp(run.track[c])) for run in self.runs)
                found[key] = (slot.parameter.lower, max(way, 2.0 * slot.parameter.lower))
        return found

    @property
    def names(self) -> list[str]:
        """Names of the recordings in the order of the rows."""
        return [run.name for run in self.runs]

    def residual(self, values: Values, pushes: Sequence[FloatArray] | None = None) -> FloatArray:
        """Return the rows of one drive, shape (N,).

        Parameters
        ----------
        values
            Parameters of the drive.
        pushes
            Additional forces on the carts [V] per recording, ndarray, shape (2, n).
        """
        parts, across = [], self.pool.map if self.pool.free else None
        for which, batch in self._batches:
            force = None if pushes is None else list(pushes[which])
            parts.append(batch.residual(values, np.zeros(len(batch.runs)), pushes=force, across=across))
        return np.concatenate(parts)

    def residuals(self, many: Sequence[Values]) -> list[FloatArray]:
        """Return the rows of many drives."""
        return list(self.pool.map(self.residual, many))

    def pushed(self, values: Values, forces: Sequence[Callable[[int], FloatArray]], size: float) -> list[FloatArray]:
        """Return how the rows change per unit of additional forces.

        Parameters
        ----------
        forces
            Functions from a recording's number to a force on each cart of order 1, ndarray, shape (2, n).
        size
            Force [V] at which the change is taken.
        """
        here = self.residual(values, [np.zeros((2, len(run.u))) for run in self.runs])

        def one(force: Callable[[int], FloatArray]) -> FloatArray:
            moved = self.residual(values, [size * force(r) for r in range(len(self.runs))])
            return np.asarray((moved - here) / size)

        return list(self.pool.map(one, forces))

    def displaced(self, values: Values, deflection: float) -> FloatArray:
        """Return how the rows change per millimetre of spring deflection at the start of every recording, shape (N,)."""
        start = np.array([0.0, 0.0, -deflection, 0.0])
        change = []
        for _, batch in self._batches:
            moved = RunBatch([replace(run, start=run.start + start) for run in batch.runs])
            none = np.zeros(len(batch.runs))
            change.append(moved.residual(values, none) - batch.residual(values, none))
        found = np.concatenate(change) / deflection
        for piece in self.pieces:
            if piece.cart == 1 and self.runs[piece.recording].positions:
                # an encoder starts where it is
                found[piece.rows] -= 1.0 * self.valid[piece.rows]
        return found

    @cached_property
    def signal(self) -> FloatArray:
        """Return the mean square of what was measured, per piece, shape (pieces,)."""
        found = []
        for p in self.pieces:
            run = self.runs[p.recording]
            y = run.measured[p.cart][run.keep[p.cart]]
            y = y - y[0] if run.positions and len(y) else y
            found.append(float(np.mean(y**2)) if len(y) else 0.0)
        return np.array(found)

    @cached_property
    def resting(self) -> list[IntArray]:
        """Return which carts rest in every block of every recording: 1 for cart 1, 2 for cart 2, 3 for both, shape (blocks,)."""
        found = []
        for run in self.runs:
            mode = np.zeros(-(-len(run.u) // run.block), dtype=np.int64)
            for c in range(len(run.keep)):
                still = _way(run.track[c], run.sample_time) <= _least_way(run, c)
                mode += (1 << c) * (still[:: run.block] & (not run.positions)).astype(np.int64)
            found.append(mode)
        return found

    def resting_with(self, values: Values) -> list[IntArray]:
        """Return which carts rest in the recordings and in the simulation of a drive, too, as :attr:`resting`."""
        simulated, found = self._velocity - self.residual(values), [mode.copy() for mode in self.resting]
        for p in self.pieces:
            run = self.runs[p.recording]
            step = run.block * run.sample_time
            still = _way(np.cumsum(simulated[p.rows]) * step, step) <= _least_way(run, p.cart)
            found[p.recording] &= np.where(still, 3, 3 & ~(1 << p.cart))
        return found

    @cached_property
    def _velocity(self) -> FloatArray:
        """Return the mean of what was measured per row, shape (N,); 0 where nothing is valid."""
        found = np.zeros(len(self.valid))
        for p in self.pieces:
            run = self.runs[p.recording]
            edges, keep = np.arange(0, len(run.u), run.block), run.keep[p.cart]
            count = np.add.reduceat(keep.astype(np.float64), edges)
            found[p.rows] = np.add.reduceat(np.where(keep, run.measured[p.cart], 0.0), edges) / np.maximum(count, 1.0)
        return found

    @cached_property
    def moves(self) -> BoolArray:
        """Return the rows in which their cart moves, shape (N,): a cart at rest tells nothing of the forces on it."""
        found = self.valid.copy()
        for p in self.pieces:
            found[p.rows] &= ((self.resting[p.recording] >> p.cart) & 1 == 0) & (not self.runs[p.recording].positions)
        return found

    @cached_property
    def rounding(self) -> dict[str, FloatArray]:
        """Return the variance of a position reading of every cart per recording, ndarray, shape (carts,) [mm²]."""
        found = {}
        for r, run in enumerate(self.runs):
            length = 1.0 if run.positions else run.block * run.sample_time
            # where no counts are known, what a block's row errs by
            floors = [self.floor[i] * length**2 for i, p in enumerate(self.pieces) if p.recording == r]
            counts = [q**2 / 12.0 for q in run.counts] or floors
            found[run.name] = np.maximum(np.array(counts[: len(run.keep)]), 1e-14)
        return found

    @cached_property
    def floor(self) -> FloatArray:
        """Return the least variance of a row that encoder counts allow, per piece, shape (pieces,)."""
        found = []
        for p in self.pieces:
            run = self.runs[p.recording]
            q = run.counts[p.cart] if len(run.counts) > p.cart else 0.0
            # a count does not average out of a position; a difference of counts errs by one over a whole block
            found.append(q**2 / 12.0 if run.positions else (q / run.sample_time / run.block) ** 2 / 6.0)
        return np.asarray(np.maximum(np.array(found), 1e-12))


def free(run: Run) -> Run:
    """Return a run whose effects of position follow the simulation from where the carts started, not the measured track.

    A spring to ground that pulls by the measured position holds no simulation back: it drifts, and says nothing of the spring.
    """
    track = np.full_like(run.track, np.nan)
    track[:, 0] = run.track[:, 0]
    return replace(run, track=track)


def comparable(recording: Recording, settings: Settings) -> Run:
    """Return a recording ready for simulation, by velocity or, where that is mostly rounding, by position."""
    run = prepare(recording)
    places = [x for x in (recording.x1, recording.x2) if x is not None]
    if len(places) != len(run.measured) or not all(q > 0.0 for q in run.counts):
        return run
    b = run.block
    for v, x, keep, q in zip(run.measured, places, run.keep, run.counts, strict=True):
        usable = v[: len(v) // b * b][keep[: len(v) // b * b]] if keep.all() else v[keep]
        blocks = usable[: len(usable) // b * b].reshape(-1, b).mean(axis=1)
        noise = q / (run.sample_time * b) / np.sqrt(6.0)
        if float(np.mean(blocks**2)) > ((1.0 + settings.small_motion) * noise) ** 2 or float(np.ptp(x)) > 40.0 * q:
            return run
    return replace(run, measured=places, floor=[q**2 / 12.0 for q in run.counts], positions=True)


def _way(x: FloatArray, step: float) -> FloatArray:
    """Return how far a cart moves within the time after which it rests, around every sample [mm], shape (n,)."""
    width = max(3, round(_REST_S / step))
    return np.asarray(maximum_filter1d(x, width) - minimum_filter1d(x, width))


def _least_way(run: Run, cart: int) -> float:
    """Return the way within that time from which on a cart moves [mm]."""
    count = run.counts[cart] if len(run.counts) > cart and run.counts[cart] > 0.0 else 0.0
    return max(1.5 * count, _STILL * float(np.ptp(run.track[cart])))


def in_rows(runs: Sequence[Run], settings: Settings) -> list[Run]:
    """Return runs with rows as they are, or twice as long where there would be too many."""
    if sum(len(run.keep) * len(run.u) // run.block for run in runs) <= settings.rows:
        return list(runs)
    return [replace(run, block_s=2.0 * run.block_s) for run in runs]


def _layout(runs: Sequence[Run]) -> tuple[list[Piece], BoolArray]:
    pieces, valid, begin = [], [], 0
    for r, run in enumerate(runs):
        edges = np.arange(0, len(run.u), run.block)
        for c, keep in enumerate(run.keep):
            pieces.append(Piece(r, c, slice(begin, begin + len(edges))))
            valid.append(np.add.reduceat(keep.astype(np.float64), edges) > 0.0)
            begin += len(edges)
    return pieces, np.concatenate(valid)

r"""The workbench of a diagnosis: every recording simulated, compared, weighted and rid of what may vary from run to run.

Residuals are block means over 5 ms of measured minus simulated velocity, one row of blocks per recording and cart. *Weighted*
by :math:`1/\sigma_{rc}`, from the floor of that channel and one common model error as in :mod:`identification.likelihood`,
they are what models are fitted to.

*Comparable* residuals, by which candidates are judged, are also rid of what surrounds every rig: friction differs from run to
run, and so does the slope of the track, for a run may begin anywhere; the track is rough, and friction wanders within a run
(:mod:`identification.mismatch.surroundings`). Along the directions :math:`D_r` of all that the residual may be anything
within the prior :math:`N(0, S)`, so :math:`\varepsilon_r^T (I + D_r S D_r^T)^{-1} \varepsilon_r` replaces the sum of squares
(N. M. Laird, J. H. Ware, Random-effects models for longitudinal data, Biometrics 38, 1982). A small effect hides among such
errors; a fit does not need that freedom, with which a drive's own friction would hardly be determined. What that prior does not
know (how such forces move resting carts, how noise is coloured by the drive) is learnt from random draws of the nuisance: along
their principal directions in every recording residuals are damped to the level of the rest (:meth:`Workbench.sharpen`).

A candidate is looked at in both *views*, among weighted and among comparable residuals. A force that is the same in all runs is
seen best among the first, for every single run might have had it by itself; most others among the second.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
import numpy.typing as npt

from flexdrive_gym.recording import FloatArray
from identification.mismatch.crew import Crew
from identification.mismatch.recent import Recent
from identification.mismatch.rows import rows_of
from identification.replay.batch import Together
from identification.replay.output_error import Run

View = Literal["comparable", "weighted"]
# columns of a whole catalogue, kept in single precision: what they explain is a share
Columns = npt.NDArray[np.float32]
# residuals of whole lab days that are kept
_REMEMBERED = 48
# days that are written at once, for a column is scattered over memory
_DAYS = 8
# columns of one task
_SIDE_BY_SIDE = 32
# tasks per thread that a lab day is split into
_PARTS = 2


@dataclass(frozen=True, eq=False)
class Disturbance:
    """What disturbs one recording.

    Attributes
    ----------
    force : ndarray, shape (2, n)
        On each cart [V].
    changes
        Parameters that differ in this recording.
    """

    force: FloatArray
    changes: Mapping[str, float]


@dataclass(frozen=True)
class Prior:
    """How far runs may differ along one direction: relative friction, or a constant force [V]."""

    group: str
    start: float
    least: float
    most: float


FRICTION = Prior("friction", 0.06, 0.02, 0.15)
OFFSET = Prior("offset", 0.01, 0.002, 0.015)


class Workbench:
    """Recordings of one drive, and what is needed to compare models of it.

    Parameters
    ----------
    runs
        Prepared recordings.
    pool
        Runs the recordings on its threads, and tasks side by side that run recordings.
    parts
        Whether they are parts of one recording: then friction and the track are the same in all.
    """

    def __init__(self, runs: Sequence[Run], pool: Crew, *, parts: bool = False) -> None:
        self.runs = list(runs)
        self.pool = pool
        self.parts = parts
        self.together = Together(self.runs)
        self._recent = Recent(_REMEMBERED)
        self.rows = rows_of(self.runs)
        self.weights = self.rows.valid.astype(float)
        self.offsets = np.zeros(len(self.runs))
        self.spread: dict[str, float] = {}
        self._absorbed: list[FloatArray] = []
        self._damped: list[FloatArray] = []
        # rms error of a model, and raw residuals of draws around it
        self.known: tuple[float, Columns] | None = None

    def unplaced(self, period: str | None) -> bool:
        """Whether an effect that repeats with this period meets every run at an unknown place; parts of one run share theirs."""
        return period is not None and not self.parts

    def alone(self) -> Workbench:
        """Return a bench for one of several tasks side by side: its weights, places and surroundings are its own.

        What takes many steps one after the other, like a refit, keeps more cores busy beside others than split up; threads that
        have no task of their own lend a hand.
        """
        other = copy(self)
        other.weights, other.offsets = self.weights.copy(), self.offsets.copy()
        return other

    def blocks(self, values: Mapping[str, float], run: int, pushes: FloatArray | None = None) -> FloatArray:
        """Return block means of measured minus simulated velocity of one recording, all carts in a row [mm/s]."""
        return self.together.residual(values, self.offsets, run, run + 1, None if pushes is None else [pushes])

    def residual(
        self, values: Mapping[str, float] | Sequence[Mapping[str, float]], *, parallel: bool = True
    ) -> FloatArray:
        """Return the block residuals of all recordings [mm/s], shape (N,), of one drive or of one per recording."""
        if not isinstance(values, Mapping):
            return self._residual(values, parallel)
        return self._recent.of(self._key(values), lambda: self._residual(values, parallel))

    def _key(self, values: Mapping[str, float], *more: str) -> Hashable:
        return (frozenset(values.items()), self.offsets.tobytes(), *more)

    def _residual(self, values: Mapping[str, float] | Sequence[Mapping[str, float]], parallel: bool) -> FloatArray:
        if not parallel:
            return self.together.residual(values, self.offsets)
        if isinstance(values, Mapping):
            out, tasks = self.together.tasks(values, self.offsets, self._shares())
            list(self.pool.map(lambda task: task(), tasks))
            return out

        def some(part: tuple[int, int]) -> FloatArray:
            return self.together.residual(values[part[0] : part[1]], self.offsets, *part)

        return np.concatenate(list(self.pool.map(some, self._shares())))

    def _shares(self) -> Iterable[tuple[int, int]]:
        """Return the recordings in shares that are worth a thread: the first of each, and the first beyond."""
        return pairwise(np.linspace(0, len(self.runs), min(len(self.runs), _PARTS * self.pool.threads) + 1).astype(int))

    def residuals(self, many: Sequence[Mapping[str, float]]) -> FloatArray:
        """Return the block residuals of many drives, shape (N, number of drives)."""
        jobs = list(self.pool.map(lambda values: self.residual(values, parallel=False), many))
        return np.column_stack(jobs) if jobs else np.zeros((len(self.weights), 0))

    def pushed(
        self, values: Mapping[str, float], pushes: Sequence[Callable[[], Sequence[FloatArray]]], size: float
    ) -> FloatArray:
        """Return what additional forces change in the residual, per volt, shape (N, forces).

        Parameters
        ----------
        pushes
            Functions that return, for every recording, the force on each cart of order 1, ndarray, shape (2, n); called
            when needed, because all together they would not fit into memory.
        size
            Force [V] at which the change is taken.
        """
        here = self._unpushed(values)

        def one(make: Callable[[], Sequence[FloatArray]]) -> FloatArray:
            return self.together.residual(values, self.offsets, pushes=[size * force for force in make()])

        return np.column_stack([(moved - here) / size for moved in self.pool.map(one, pushes)])

    def disturbed(self, values: Mapping[str, float], days: Sequence[Callable[[], Sequence[Disturbance]]]) -> FloatArray:
        """Return what disturbances change in the residual, shape (N, days).

        Parameters
        ----------
        days
            Functions that return a disturbance for every recording, called when needed.
        """
        here, found = self._unpushed(values), np.empty((len(self.weights), len(days)))

        def some(first: int) -> None:
            moved = []
            for make in days[first : first + _DAYS]:
                met = make()
                drives = [{**values, **d.changes} for d in met]
                moved.append(self.together.residual(drives, self.offsets, pushes=[d.force for d in met]) - here)
            found[:, first : first + _DAYS] = np.column_stack(moved)

        list(self.pool.map(some, range(0, len(days), _DAYS)))
        return found

    def _unpushed(self, values: Mapping[str, float]) -> FloatArray:
        """Return the residual under forces of zero: what forces change is then no matter of how steps are taken."""

        def found() -> FloatArray:
            nothing = [np.zeros((2, len(run.u))) for run in self.runs]
            return self.together.residual(values, self.offsets, pushes=nothing)

        return self._recent.of(self._key(values, "unpushed"), found)

    def weigh(self, residual: FloatArray) -> None:
        """Set weights from the residuals of the present model."""
        n, own, floor, pieces = [], [], [], []
        for r, run in enumerate(self.runs):
            for c in range(len(run.keep)):
                piece = self.piece(r, c)
                e = residual[piece][self.rows.valid[piece]]
                pieces.append(piece)
                n.append(max(len(e), 1))
                own.append(float(e @ e) / max(len(e), 1))
                # a floor is the variance of a block sum over the root of its samples
                floor.append(run.floor[c] / run.block)
        count, measured, least = np.array(n), np.array(own), np.array(floor)
        error = max(float((measured - least) @ count / count.sum()), 0.01 * float(measured @ count / count.sum()))
        for piece, f in zip(pieces, least, strict=True):
            self.weights[piece] = self.rows.valid[piece] / np.sqrt(f + error)

    def piece(self, run: int, cart: int) -> slice:
        """Return the rows of one recording and cart."""
        start = self.rows.starts[run] + cart * self.rows.blocks[run]
        return slice(start, start + self.rows.blocks[run])

    def weighted(self, x: FloatArray | Columns) -> FloatArray:
        """Weight residuals or sensitivities, shape (N,) or (N, k)."""
        return self._recording_by_recording(x, ())

    @property
    def views(self) -> tuple[View, ...]:
        """The ways of looking at residuals that differ, the one for most questions first."""
        return ("comparable", "weighted") if self._absorbed else ("comparable",)

    def seen(self, view: View, x: FloatArray | Columns) -> FloatArray:
        """Return raw residuals or sensitivities, shape (N,) or (N, k), in a view."""
        return self.comparable(x) if view == "comparable" else self.weighted(x)

    def set_random_effects(self, directions: FloatArray, residual: FloatArray, priors: Sequence[Prior]) -> None:
        """Let the runs differ along the given weighted directions; estimate by how much.

        Parameters
        ----------
        directions
            Weighted sensitivities, shape (N, k).
        residual
            Weighted residual, shape (N,).
        priors
            One per direction: the group it shares its spread with, where the estimate starts and may go. One round of
            expectation maximisation.
        """
        groups = sorted({p.group for p in priors})
        start = {p.group: p.start for p in priors}
        found, variance = [], np.zeros(len(priors))
        for r in range(len(self.runs)):
            D, e = directions[self.rows.of(r)], residual[self.rows.of(r)]
            covariance = np.linalg.inv(D.T @ D + np.diag([start[p.group] ** -2 for p in priors]))
            found.append(covariance @ (D.T @ e))
            variance += np.diag(covariance) / len(self.runs)
        # what all runs have in common is no spread but physics
        own = np.var(np.array(found), axis=0) + variance
        square = {g: float(np.mean([v for v, p in zip(own, priors, strict=True) if p.group == g])) for g in groups}
        limits = {p.group: (p.least, p.most) for p in priors}
        self.spread = {g: float(np.clip(np.sqrt(square[g]), *limits[g])) for g in groups}
        scale = np.array([self.spread[p.group] for p in priors])
        self._absorbed = self._absorbing(directions, scale)

    def set_surroundings(self, directions: FloatArray, sizes: FloatArray) -> None:
        """Also let the track be rough and friction wander, where residuals are compared.

        Parameters
        ----------
        directions
            Weighted sensitivities to everything that may differ, shape (N, k).
        sizes
            Standard deviations, shape (k,).
        """
        self._absorbed = self._absorbing(directions, sizes)

    def sharpen(self, disturbances: FloatArray | Columns, hidden: FloatArray, modes: int) -> None:
        """Also damp what random disturbances do most in every recording, until it is no larger than the rest of what they do.

        Parameters
        ----------
        disturbances
            Raw residuals of draws, shape (N, draws).
        hidden
            Orthonormal comparable directions of the present model, which its fit takes out, shape (N, m).
        modes
            How many principal directions per recording.
        """
        self._damped = []
        X = self.comparable(disturbances)
        square = self.without(X, hidden)
        # of every draw its shape, for the mixture matters and not its size
        X /= np.maximum(np.sqrt(square / len(X)), 1e-300)
        X /= np.sqrt(X.shape[1])

        def damping(r: int) -> FloatArray:
            part = X[self.rows.of(r)]
            square, V = np.linalg.eigh(part.T @ part)
            first = np.argsort(-square)[:modes]
            rest = max(float(square.sum() - square[first].sum()), 0.0) / max(len(part) - modes, 1)
            use = first[square[first] > max(rest, 1e-12 * float(square.sum()))]
            U = part @ (V[:, use] / np.sqrt(square[use]))
            return np.asarray(U * np.sqrt(1.0 - np.sqrt(rest / square[use])))

        self._damped = list(self.pool.map(damping, range(len(self.runs))))

    def _absorbing(self, directions: FloatArray, sizes: FloatArray) -> list[FloatArray]:
        def one(r: int) -> FloatArray:
            # (I + D S Dᵀ)^(-1/2) = I - U (1 - 1/sqrt(1 + σ²)) Uᵀ, with the singular vectors of D S^(1/2)
            U, sigma, _ = np.linalg.svd(directions[self.rows.of(r)] * sizes, full_matrices=False)
            return np.asarray(U * np.sqrt(1.0 - 1.0 / np.sqrt(1.0 + sigma**2)))

        return list(self.pool.map(one, range(len(self.runs))))

    def forget_random_effects(self) -> None:
        """Let all recordings be alike."""
        self._absorbed, self._damped, self.spread = [], [], {}

    def comparable(self, x: FloatArray | Columns) -> FloatArray:
        """Weight, and take out what differs from run to run and the surroundings: what candidates are judged by."""
        return self._recording_by_recording(x, (self._absorbed, self._damped))

    def _recording_by_recording(self, x: FloatArray | Columns, taken_out: Sequence[Sequence[FloatArray]]) -> FloatArray:
        y = np.empty(x.shape)
        weights = self.weights if x.ndim == 1 else self.weights[:, None]

        def some(part: tuple[int, int]) -> None:
            for r in range(*part):
                rows = self.rows.of(r)
                np.multiply(x[rows], weights[rows], out=y[rows])
                for taken in taken_out:
                    if taken:
                        y[rows] -= taken[r] @ (taken[r].T @ y[rows])

        list(self.pool.map(some, self._shares()))
        return y

    def without(self, X: FloatArray, hidden: FloatArray) -> FloatArray:
        """Take orthonormal directions, shape (N, m), out of columns, shape (N, k), in place.

        Returns
        -------
        ndarray, shape (k,)
            The squares of what is left of the columns.
        """
        square = np.empty(X.shape[1])

        def rid(first: int) -> None:
            part = X[:, first : first + _SIDE_BY_SIDE]
            part -= hidden @ (hidden.T @ part)
            square[first : first + _SIDE_BY_SIDE] = np.sum(part**2, axis=0)

        list(self.pool.map(rid, range(0, X.shape[1], _SIDE_BY_SIDE)))
        return square

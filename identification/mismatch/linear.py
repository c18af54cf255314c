"""All candidates around the present simulation at once: whitened sensitivities, and the normal equations of any set of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexdrive_gym.drive.parameters import fastest
from flexdrive_gym.recording import FloatArray
from identification.mismatch.bench import Bench
from identification.mismatch.candidates.catalogue import Candidate
from identification.mismatch.candidates.free import Shape
from identification.mismatch.candidates.phases import Phase, phases
from identification.mismatch.fit import FASTEST, Fit
from identification.mismatch.noise import Noise
from identification.mismatch.score import Normal
from identification.replay.output_error import PHYSICS_S


@dataclass(frozen=True, eq=False)
class Entry:
    """A candidate and its columns among all columns.

    An effect whose phase differs from run to run has two, of which every recording takes its own share.
    """

    candidate: Candidate | Shape | Phase
    columns: tuple[int, ...]

    @property
    def random(self) -> bool:
        """Whether every recording has its own amplitudes."""
        return isinstance(self.candidate, Phase)


@dataclass(frozen=True, eq=False)
class Linear:
    """Sensitivities of all candidates, whitened: the base model's columns first, then every candidate's.

    Attributes
    ----------
    bench
        The recordings.
    entries
        Candidates that change the simulation.
    base
        Columns of the base model.
    columns : ndarray, shape (N, M)
        Raw sensitivities.
    white : ndarray, shape (N, M)
        Whitened ones.
    products : ndarray, shape (U, M, M)
        Of whitened columns, per unit.
    residual : ndarray, shape (N,)
        Whitened.
    """

    bench: Bench
    entries: tuple[Entry, ...]
    base: tuple[int, ...]
    columns: FloatArray
    white: FloatArray
    products: FloatArray
    residual: FloatArray

    @classmethod
    def of(
        cls, bench: Bench, noise: Noise, columns: FloatArray, residual: FloatArray, entries: Sequence[Entry], base: int
    ) -> Linear:
        """Whiten columns and residual."""
        white = noise.white(columns)
        return cls(
            bench, tuple(entries), tuple(range(base)), columns, white, bench.products(white), noise.white(residual)
        )

    def gradient(self, residual: FloatArray) -> FloatArray:
        """Return the products of all columns with whitened residuals per unit, shape (U, M, k), from shape (N, k)."""
        found = np.zeros((len(self.products), self.white.shape[1], residual.shape[1]))
        for rows, u in zip(self.bench.rows, self.bench.units, strict=True):
            found[u] += self.white[rows].T @ residual[rows]
        return found

    def square(self, residual: FloatArray) -> FloatArray:
        """Return the squares of whitened residuals per unit, shape (U, k)."""
        found = np.zeros((len(self.products), residual.shape[1]))
        for rows, u in zip(self.bench.rows, self.bench.units, strict=True):
            found[u] += np.sum(residual[rows] ** 2, axis=0)
        return found

    def normal(self, gradient: FloatArray, square: FloatArray, more: Sequence[int] = ()) -> Normal:
        """Return the normal equations of the base model with some columns.

        Parameters
        ----------
        gradient, square : ndarray, shapes (U, M) and (U,)
        """
        use = [*self.base, *more]
        return Normal(self.products[np.ix_(range(len(self.products)), use, use)], gradient[:, use], square)

    def around(self, model: Fit, noise: Noise) -> Linear:
        """Return the candidates' columns with another base model and other noise, near enough for them to stay what they are."""
        inner = model.jacobian[:, model.interior]
        p, more = inner.shape[1], len(self.base)
        entries = [Entry(e.candidate, tuple(c - more + p for c in e.columns)) for e in self.entries]
        columns = np.column_stack([inner, self.columns[:, more:]])
        return Linear.of(self.bench, noise, columns, model.residual, entries, p)


def linearise(
    bench: Bench, noise: Noise, model: Fit, candidates: Sequence[Candidate], shapes: Sequence[Shape]
) -> Linear:
    """Return the sensitivities of all candidates around a model.

    A candidate's columns are the change at its plainly present size over that size, for non-linear effects look different when
    small; a shape's are those of its forces.
    """
    present = [c for c in candidates if not any(k in model.values for k, _ in c.sizes)]
    drives = {}
    for c in present:
        for i in range(len(c.sizes)):
            effect = c.one(i)
            drives[tuple(sorted(effect.items()))] = ({**model.values, **effect}, c.sizes[i][1])
    drives = {k: v for k, v in drives.items() if fastest(v[0])[0] * PHYSICS_S < FASTEST}
    moved = bench.residuals([v for v, _ in drives.values()])
    here = model.residual
    found = {k: (m - here) / size for (k, (_, size)), m in zip(drives.items(), moved, strict=True)}
    columns: list[FloatArray] = list(model.jacobian[:, model.interior].T)
    base = len(columns)
    entries = []
    place: dict[object, int] = {}
    for c in present:
        keys = [tuple(sorted(c.one(i).items())) for i in range(len(c.sizes))]
        if any(k not in found or not np.any(found[k]) for k in keys):
            continue
        for k in keys:
            if k not in place:
                place[k] = len(columns)
                columns.append(found[k])
        entries.append(Entry(c, tuple(place[k] for k in keys)))
    names = {c.name for c in present}
    free_ones: list[tuple[Shape | Phase, Sequence[FloatArray]]] = [
        *((s, bench.pushed(model.values, s.forces, s.size)) for s in shapes),
        *((p, change) for p, change in phases(bench, model.values) if p.name in names),
    ]
    for free, made in free_ones:
        first = len(columns)
        columns += [p for p in made if np.any(p)]
        if len(columns) > first:
            entries.append(Entry(free, tuple(range(first, len(columns)))))
    return Linear.of(bench, noise, np.column_stack(columns), here, entries, base)

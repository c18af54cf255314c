"""All candidates around the present simulation at once: their sensitivities, and the normal equations of any set of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexdrive_gym.drive.parameters import fastest
from flexdrive_gym.recording import FloatArray
from identification.diagnosis.bench import Bench
from identification.diagnosis.candidates.catalogue import Candidate
from identification.diagnosis.candidates.free import Shape
from identification.diagnosis.fit import Fit
from identification.diagnosis.noise import Noise
from identification.diagnosis.score import Normal
from identification.replay.output_error import PHYSICS_S

# faster effects are as good as instantaneous
_FASTEST = 30.0


@dataclass(frozen=True, eq=False)
class Entry:
    """A candidate and its columns among all columns."""

    candidate: Candidate | Shape
    columns: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Linear:
    """Products of all columns: the base model's first, then every candidate's, the residual last.

    Attributes
    ----------
    entries
        Candidates that change the simulation.
    base
        Columns of the base model.
    plain, white : ndarray, shape (R, M + 1, M + 1)
        Products per recording, in the metric of estimates and in that of scores.
    columns : ndarray, shape (N, M)
        Raw sensitivities.
    noise
        Of the rows.
    """

    entries: tuple[Entry, ...]
    base: tuple[int, ...]
    plain: FloatArray
    white: FloatArray
    columns: FloatArray
    noise: Noise

    def normal(self, more: Sequence[int] = (), *, plain: bool = False) -> Normal:
        """Return the normal equations of the base model with some columns; ``plain`` scores without run-to-run variability."""
        use = [*self.base, *more, self.plain.shape[1] - 1]
        index = np.ix_(range(len(self.plain)), use, use)
        return Normal.from_products(self.plain[index], self.plain[index] if plain else self.white[index])

    def around(self, model: Fit, noise: Noise) -> Linear:
        """Return the candidates' columns with another base model and other noise, near enough for them to stay what they are."""
        inner = model.jacobian[:, model.interior]
        p, more = inner.shape[1], len(self.base)
        entries = tuple(Entry(e.candidate, tuple(c - more + p for c in e.columns)) for e in self.entries)
        columns = np.column_stack([inner, self.columns[:, more:]])
        return products(noise, columns, model.residual, entries, tuple(range(p)))

    def against(self, residual: FloatArray) -> Linear:
        """Return the same columns with another residual."""
        plain, white = self.plain.copy(), self.white.copy()
        for r, rows in enumerate(self.noise.rows):
            e = residual[rows] * self.noise.weights[rows]
            C = self.columns[rows] * self.noise.weights[rows][:, None]
            products = [(plain, C, e)]
            if self.noise.modes:
                U = self.noise.modes[r]
                f = e - U @ (U.T @ e)
                # the whitening is symmetric: it may act twice on the residual instead of on every column
                products.append((white, C, f - U @ (U.T @ f)))
            else:
                products.append((white, C, e))
            for out, columns, y in products:
                out[r, -1, :-1] = out[r, :-1, -1] = columns.T @ y
            plain[r, -1, -1] = float(e @ e)
            white[r, -1, -1] = float(e @ products[1][2])
        return Linear(self.entries, self.base, plain, white, self.columns, self.noise)


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
    drives = {k: v for k, v in drives.items() if fastest(v[0])[0] * PHYSICS_S < _FASTEST}
    moved = bench.residuals([v for v, _ in drives.values()])
    here = model.residual
    found = {k: (m - here) / size for (k, (_, size)), m in zip(drives.items(), moved, strict=True)}
    columns: list[FloatArray] = list(model.jacobian[:, model.interior].T)
    base = tuple(range(len(columns)))
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
    for shape in shapes:
        pushed = bench.pushed(model.values, shape.forces, shape.size)
        first = len(columns)
        columns += [p for p in pushed if np.any(p)]
        if len(columns) > first:
            entries.append(Entry(shape, tuple(range(first, len(columns)))))
    return products(noise, np.column_stack(columns), here, tuple(entries), base)


def products(
    noise: Noise, columns: FloatArray, residual: FloatArray, entries: tuple[Entry, ...], base: tuple[int, ...]
) -> Linear:
    """Return the products of columns and residual per recording, in both metrics."""
    both = np.column_stack([columns, residual])
    plain, white = [], []
    for r, rows in enumerate(noise.rows):
        y = both[rows] * noise.weights[rows][:, None]
        plain.append(y.T @ y)
        if noise.modes:
            U = noise.modes[r]
            # of a projection the products need no whitened rows
            T = U.T @ y
            white.append(plain[-1] - T.T @ (2.0 * T - (U.T @ U) @ T))
        else:
            white.append(plain[-1])
    return Linear(entries, base, np.array(plain), np.array(white), columns, noise)

"""All candidates around the present simulation at once: whitened sensitivities, and the normal equations of any set of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain

import numpy as np

from flexdrive_gym.recording import FloatArray
from identification.mismatch.candidates.catalogue import Candidate
from identification.mismatch.candidates.free import Shape
from identification.mismatch.candidates.phases import Phase, phases
from identification.mismatch.fitting.bench import Bench, Columns, SingleArray
from identification.mismatch.fitting.fit import Fit, resolved
from identification.mismatch.fitting.levels import Levels
from identification.mismatch.fitting.score import Normal
from identification.mismatch.noise.estimate import Noise

# standard deviations of what all recordings may share: of parameters as a fit scales them, of candidates over their usual sizes
_PARAMETER, _LARGE = 0.3, 3.0
# information under which noise hides a change of unit variance
_HIDDEN = 0.05
# change over what is left from which on it is none of what may be there, and cosine of two changes from which on they are one
_FAR, _ALONG = 4.0, 0.95

# an effect of one size, without the others
Key = tuple[tuple[str, float], ...]


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
    model
        That they are taken around.
    noise
        That whitens them.
    entries
        Candidates that change the simulation.
    changes : ndarray of float32, shape (N, M - p)
        Raw sensitivities to the candidates, in single precision: there are hundreds.
    white : ndarray of float32, shape (N, M)
        Whitened ones, the p of the base model first.
    products : ndarray, shape (U, M, M)
        Of whitened columns, per unit.
    residual : ndarray, shape (N,)
        Whitened.
    """

    model: Fit
    noise: Noise
    entries: tuple[Entry, ...]
    changes: SingleArray
    white: SingleArray
    products: FloatArray
    residual: FloatArray

    @classmethod
    def of(cls, model: Fit, noise: Noise, changes: SingleArray, entries: Sequence[Entry]) -> Linear:
        """Whiten columns and residual."""
        bench, inner = model.bench, model.jacobian[:, model.interior]
        white = noise.white(np.hstack([inner.astype(np.float32), changes], dtype=np.float32), bench.pool.map)
        products = bench.products(white, across=bench.pool.map)
        return cls(model, noise, tuple(entries), changes, white, products, noise.white(model.residual))

    @property
    def bench(self) -> Bench:
        """The recordings."""
        return self.model.bench

    @property
    def base(self) -> range:
        """Columns of the base model."""
        return range(self.white.shape[1] - self.changes.shape[1])

    @property
    def shared(self) -> SingleArray:
        """Return the whitened columns of what all recordings share, shape (N, k)."""
        return self.white[:, [*self.base, *dict.fromkeys(c for e in self.entries if not e.random for c in e.columns)]]

    @cached_property
    def common(self) -> SingleArray:
        """Return raw changes that all recordings may share, each as large as it may well be, shape (N, m)."""
        sizes = dict.fromkeys(self.base, _PARAMETER)
        for e in self.entries:
            if isinstance(e.candidate, Candidate):
                sizes |= {c: _LARGE * abs(s) for c, (_, s) in zip(e.columns, e.candidate.sizes, strict=True)}
            elif isinstance(e.candidate, Shape):
                sizes |= dict.fromkeys(e.columns, _LARGE * e.candidate.size)
        use, size, p = list(sizes), np.array(list(sizes.values())), len(self.base)
        information = self.products.sum(axis=0)[np.ix_(use, use)]
        square, V = np.linalg.eigh(information * np.outer(size, size))
        # what noise hides is left out
        seen = square > _HIDDEN
        turn = np.zeros((self.white.shape[1], int(seen.sum())), np.float32)
        turn[use] = V[:, seen] * size[:, None]
        inner = self.model.jacobian[:, self.model.interior].astype(np.float32)
        return np.asarray(inner @ turn[:p] + self.changes @ turn[p:])

    def moved(self, more: Sequence[int], step: FloatArray) -> FloatArray:
        """Return the raw residual after a step of the base model's parameters and of some columns."""
        model, p = self.model, len(self.base)
        own = self.changes[:, [c - p for c in more]] @ step[p:]
        return np.asarray(model.residual + model.jacobian[:, model.interior] @ step[:p] + own)

    def gradient(self, residual: Columns) -> FloatArray:
        """Return the products of all columns with whitened residuals per unit, shape (U, M, k), from shape (N, k)."""
        return self.bench.products(self.white, residual)

    def square(self, residual: Columns) -> FloatArray:
        """Return the squares of whitened residuals per unit, shape (U, k)."""
        return self.bench.sums(np.square(residual, dtype=np.float64))

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
        if noise is self.noise and model is self.model:
            return self
        p, before = int(np.sum(model.interior)), len(self.base)
        entries = tuple(Entry(e.candidate, tuple(c + p - before for c in e.columns)) for e in self.entries)
        if noise is not self.noise:
            return Linear.of(model, noise, self.changes, entries)
        # the candidates' columns stay what they are
        inner = noise.white(model.jacobian[:, model.interior].astype(np.float32))
        white = np.column_stack([inner, self.white[:, before:]])
        own = self.bench.products(inner, white, self.bench.pool.map)
        products = np.empty((len(own), white.shape[1], white.shape[1]))
        products[:, p:, p:] = self.products[:, before:, before:]
        products[:, :p], products[:, :, :p] = own, own.transpose(0, 2, 1)
        return Linear(model, noise, entries, self.changes, white, products, noise.white(model.residual))


def linearise(
    bench: Bench, noise: Noise, model: Fit, candidates: Sequence[Candidate], shapes: Sequence[Shape]
) -> Linear:
    """Return the sensitivities of all candidates around a model.

    A candidate's columns are the change at its plainly present size over that size, for non-linear effects look different when
    small. Where that is far more than what is left, and a change that is as much points another way, the candidate has both: a
    spring that is plainly harder has another resonance, and such motion says nothing of one that is a little harder. A shape's
    columns are those of its forces.
    """
    present = [c for c in candidates if not any(k in model.values for k, _ in c.sizes)]
    changes, lesser = _changes(model, present)
    columns: list[SingleArray] = []
    base = int(np.sum(model.interior))
    entries = []
    place: dict[Key, int] = {}
    for c in present:
        keys = _keys(c)
        if any(k not in changes or not np.any(changes[k]) for k in keys):
            continue
        for own in dict.fromkeys((tuple(keys), tuple(lesser.get(k, k) for k in keys))):
            for k in own:
                if k not in place:
                    place[k] = base + len(columns)
                    columns.append(changes[k])
            entries.append(Entry(c, tuple(place[k] for k in own)))
    names = {c.name for c in present}
    free_ones: Iterable[tuple[Shape | Phase, Sequence[FloatArray]]] = chain(
        ((s, bench.pushed(model.values, s.forces, s.size)) for s in shapes),
        ((p, change) for p, change in phases(bench, model.values) if p.name in names),
    )
    for free, made in free_ones:
        first = base + len(columns)
        columns += [p.astype(np.float32) for p in made if np.any(p)]
        if base + len(columns) > first:
            entries.append(Entry(free, tuple(range(first, base + len(columns)))))
    return Linear.of(model, noise, np.column_stack(columns), entries)


def _keys(candidate: Candidate) -> list[Key]:
    return [tuple(sorted(candidate.one(i).items())) for i in range(len(candidate.sizes))]


def _changes(model: Fit, candidates: Sequence[Candidate]) -> tuple[dict[Key, SingleArray], dict[Key, Key]]:
    """Return the changes of rows over the sizes of effects, and the lesser effect of those that point elsewhere when lesser."""
    sizes: dict[Key, str] = {}
    proportional = set[Key]()
    for c in candidates:
        for key, (name, _) in zip(_keys(c), c.sizes, strict=True):
            if resolved({**model.values, **dict(key)}):
                sizes[key] = name
                proportional |= {key} if c.proportional else set()
    usual = _changes_over(model, sizes)
    ratios = _over_what_is_left(model, [change * dict(key)[sizes[key]] for key, change in usual.items()])
    lesser = {
        key: tuple((n, v / ratio if n == sizes[key] else v) for n, v in key)
        for key, ratio in zip(usual, ratios, strict=True)
        if ratio > _FAR and key in proportional
    }
    changes = _changes_over(model, {less: sizes[key] for key, less in lesser.items()})
    elsewhere = {key: less for key, less in lesser.items() if _points_elsewhere(changes[less], usual[key])}
    return {**changes, **usual}, elsewhere


def _changes_over(model: Fit, sizes: Mapping[Key, str]) -> dict[Key, SingleArray]:
    """Return the changes that effects make, each over the size that is named beside it, shape (N,)."""
    moved = model.bench.residuals([{**model.values, **dict(key)} for key in sizes])
    return {
        key: ((rows - model.residual) / dict(key)[size]).astype(np.float32)
        for (key, size), rows in zip(sizes.items(), moved, strict=True)
    }


def _over_what_is_left(model: Fit, changes: Sequence[Columns]) -> list[float]:
    """Return the norm of every change, but for what base parameters can do, over that of the residual; by output error."""
    levels = Levels.of(model.bench, model.residual)
    left = max(float(np.linalg.norm(levels.white(model.residual))), np.finfo(float).tiny)
    Q, _ = np.linalg.qr(levels.white(model.jacobian[:, model.interior]))

    def over(change: Columns) -> float:
        own = levels.white(np.asarray(change, dtype=np.float64))
        return float(np.linalg.norm(own - Q @ (Q.T @ own))) / left

    return list(model.bench.pool.map(over, changes))


def _points_elsewhere(change: SingleArray, usual: SingleArray) -> bool:
    length = float(np.linalg.norm(change) * np.linalg.norm(usual))
    return length > 0.0 and float(change @ usual) < _ALONG * length

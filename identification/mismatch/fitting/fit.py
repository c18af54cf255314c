"""Fits of a drive to all recordings, in the metric of their noise.

Whitened by the innovations of a disturbed drive (:mod:`identification.mismatch.noise.estimate`) a fit minimises prediction
errors, which are
small as soon as the equations of motion hold, so that it finds a drive from far away. Weighted by noise levels alone it minimises
output errors, which judge long horizons.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import isfinite
from typing import Protocol

import numpy as np

from flexdrive_gym.drive.effects import LAYOUT
from flexdrive_gym.drive.parameters import fastest, parameter
from flexdrive_gym.recording import BoolArray, FloatArray
from identification.mismatch.fitting.bench import Bench, Values
from identification.mismatch.fitting.score import Normal, bounded

# step of a finite difference, in scaled coordinates, far above round-off: sticking makes residuals smooth only piece by piece
_STEP = 2e-3
# the fastest rate of an effect that a fit may reach [1/s]: a simulation takes as many steps a millisecond as it has thousands. No
# lag is faster, for a short one needs no finer steps
_FASTEST = 5e3


class Metric(Protocol):
    """What turns rows into white ones."""

    def white(self, x: FloatArray) -> FloatArray:
        """Return whitened rows of raw ones, shape (N,) or (N, k)."""


_MASSES = frozenset({"m1", "m2", "k"})
# of the lighter cart's: a mass of its own that is less moves with its cart, or follows the command, as far as anyone sees
_LEAST_MASS = 0.01
_LONGEST_STEP = 0.7


@dataclass(frozen=True, eq=False)
class Fit:
    """A drive at an optimum.

    Attributes
    ----------
    values
        Its parameters.
    names
        Those that were fitted.
    cost
        Squared whitened residual.
    residual : ndarray, shape (N,)
        Raw rows.
    coordinates
        In which it was fitted.
    known : ndarray, shape (N, p), or None
        The derivatives, where the fit ended with them.
    """

    values: dict[str, float]
    names: tuple[str, ...]
    cost: float
    residual: FloatArray
    coordinates: Coordinates
    bench: Bench
    metric: Metric
    known: FloatArray | None = None

    @cached_property
    def jacobian(self) -> FloatArray:
        """Return the derivatives of the raw rows with respect to the scaled coordinates, shape (N, p)."""
        if self.known is not None:
            return self.known
        z = self.coordinates.of(self.values)
        return _jacobian(self.bench, self.coordinates, z, self.values, self.residual)

    @cached_property
    def interior(self) -> BoolArray:
        """Return which parameters do not rest at a bound, shape (p,)."""
        c, z = self.coordinates, self.coordinates.of(self.values)
        return np.asarray((z > c.low + 1e-9) & (z < c.high - 1e-9) & np.any(self.jacobian, axis=0))

    @cached_property
    def scale(self) -> FloatArray:
        """Return the change of a parameter per unit of its coordinate, shape (p,)."""
        return self.coordinates.rate(self.coordinates.of(self.values))

    @cached_property
    def white(self) -> FloatArray:
        """Return whitened derivatives by the parameters that do not rest at a bound, and the residual, shape (N, p + 1)."""
        return self.metric.white(np.column_stack([self.jacobian[:, self.interior], self.residual]))

    @cached_property
    def normal(self) -> Normal:
        """Return the normal equations per unit."""
        return Normal.of(self.bench.products(self.white))


def gain_of(without: Fit, with_: Fit) -> FloatArray:
    """Return the gain of predictive log-likelihood of a model that contains another, within what the two let expect, (U,).

    What the recordings that were fitted gain, less one for every parameter more, which is what leaving experiments out comes to
    (M. Stone, J. R. Stat. Soc. B 39, 1977). Steps to the others' optima from two optima of a rough likelihood differ by more
    than the effect makes.
    """
    bench = with_.bench
    one, other = without.metric.white(without.residual), with_.metric.white(with_.residual)
    square = bench.sums(np.column_stack([one, other, one - other]) ** 2)
    more = len(with_.names) - len(without.names)
    return bounded(0.5 * (square[:, 0] - square[:, 1]) - more / len(square), 0.5 * square[:, 2])


def resolved(values: Values) -> bool:
    """Whether a simulation resolves a drive: what is as good as rigid takes thousands of steps a sample for nothing."""
    return fastest(values)[0] <= _FASTEST


class Coordinates:
    """Parameters as an optimiser sees them: logarithms of what is positive, the rest against a typical size."""

    def __init__(
        self, names: Sequence[str], start: Values, bounds: Mapping[str, tuple[float, float]] | None = None
    ) -> None:
        self.names = tuple(names)
        self.log = np.array([_logarithmic(n) for n in names], dtype=bool)
        self.scale = np.array([_typical(n, start) for n in names])
        limits = [(bounds or {}).get(n, (_least(n, start), parameter(n).upper)) for n in names]
        self.lower, self.upper = low, high = np.array(limits, dtype=np.float64).reshape(-1, 2).T
        with np.errstate(divide="ignore"):
            self.low = np.where(self.log, np.log(np.maximum(low, 1e-300)), low / self.scale)
            self.high = np.where(self.log, np.log(np.maximum(high, 1e-300)), high / self.scale)

    def of(self, values: Values) -> FloatArray:
        """Return the coordinates of a drive, within bounds."""
        x = np.array([values.get(n, parameter(n).null) for n in self.names])
        z = np.where(self.log, np.log(np.maximum(x, 1e-300)), x / self.scale)
        return np.asarray(np.clip(z, self.low, self.high))

    def to(self, z: FloatArray, values: Values) -> dict[str, float]:
        """Return the drive at coordinates."""
        z = np.clip(z, self.low, self.high)
        # rounding must not lead across a bound
        x = np.clip(np.where(self.log, np.exp(np.where(self.log, z, 0.0)), z * self.scale), self.lower, self.upper)
        return {**values, **{n: float(v) for n, v in zip(self.names, x, strict=True)}}

    def rate(self, z: FloatArray) -> FloatArray:
        """Return the change of every parameter per unit of its coordinate."""
        return np.asarray(np.where(self.log, np.exp(np.where(self.log, z, 0.0)), self.scale))


def _logarithmic(name: str) -> bool:
    if name in _MASSES:
        return True
    q = LAYOUT[name].parameter
    return (q.role == "shape" and q.lower >= 0.0) or not isfinite(q.null)


def _least(name: str, start: Values) -> float:
    q = parameter(name)
    if name in _MASSES or q.unit != parameter("m1").unit:
        return q.lower
    return max(q.lower, _LEAST_MASS * min(start[m] for m in ("m1", "m2") if m in start))


def _typical(name: str, start: Values) -> float:
    if name in {"b1", "b2", "d1", "d2"}:
        same = [abs(start.get(f"{name[0]}{c}", 0.0)) for c in (1, 2)]
        mass = start.get("m1", 1.0)
        return max(abs(start.get(name, 0.0)), 0.1 * max(same), 1.0 * mass if name[0] == "b" else 1e-3)
    own = abs(start.get(name, 0.0))
    return own if own > 0.0 else next((abs(v) for v in LAYOUT[name].parameter.starts if v != 0.0), 1.0)


def fit(
    bench: Bench,
    metric: Metric,
    start: Values,
    names: Sequence[str],
    *,
    iterations: int | None = None,
    near: Fit | None = None,
    step: float = _STEP,
) -> Fit:
    """Fit parameters by damped Gauss-Newton steps (K. Levenberg 1944, D. Marquardt 1963) within their bounds.

    Derivatives are carried along accepted steps (C. G. Broyden, Math. Comp. 19, 1965) and made anew when steps no longer help.

    Parameters
    ----------
    start
        Drive to start from.
    names
        Parameters to fit.
    iterations
        Most steps of a first try, which ends when they no longer help; default: as many as it takes, up to the settings' most.
    near
        A fit whose derivatives hold at the start, or nearly so, for the parameters that it shares.
    step
        Of finite differences, in scaled coordinates: a long one sees over what is rough nearby.
    """
    settings = bench.settings
    c = Coordinates(names, start, bench.bounds)
    z, damping, worked = c.of(start), 1e-3, 1e-3
    now = c.to(z, start)
    raw = bench.residual(now)
    white = metric.white(raw)
    cost, fresh = float(white @ white), near is None or near.values == start
    made = _jacobian(bench, c, z, now, raw, step, near)
    S: FloatArray | None = made
    W = metric.white(made)
    for _ in range(settings.iterations if iterations is None else iterations):
        H, g, before = W.T @ W, W.T @ white, cost
        for _attempt in range(6 if fresh else 2):
            new = _stepped(c, z, H, g, damping)
            trial = c.to(new, start)
            if resolved(trial):
                moved = bench.residual(trial)
                moved_white = metric.white(moved)
                square = float(moved_white @ moved_white)
                if square < cost:
                    dz = new - z
                    along = dz / max(float(dz @ dz), 1e-300)
                    # whitening is linear; raw derivatives are asked for only where a fit ends, one step from where they were made
                    W += np.outer(moved_white - white - W @ dz, along)
                    S = S + np.outer(moved - raw - S @ dz, along) if fresh and S is not None else None
                    z, now, raw, white, cost = new, trial, moved, moved_white, square
                    worked = damping = max(0.2 * damping, 1e-7)
                    break
            damping = 8.0 * max(damping, 1e-3)
        stalled = before - cost < settings.tolerance * cost
        if stalled and (fresh or iterations is not None):
            break
        if stalled or before - cost > 0.5 * before:
            # derivatives that were carried too far say nothing of the damping that those of this place need
            made = _jacobian(bench, c, z, now, raw, step)
            S, damping = made, min(worked, 1e-2)
            W = metric.white(made)
        fresh = stalled
    return Fit(now, c.names, cost, raw, c, bench, metric, S if fresh else None)


def _stepped(c: Coordinates, z: FloatArray, H: FloatArray, g: FloatArray, damping: float) -> FloatArray:
    free = ~(((z <= c.low + 1e-12) & (g > 0.0)) | ((z >= c.high - 1e-12) & (g < 0.0))) & (np.diag(H) > 0.0)
    step = np.zeros(len(z))
    if free.any():
        A = H[np.ix_(free, free)]
        step[free] = -np.linalg.solve(A + damping * np.diag(np.diag(A)), g[free])
    longest = float(np.max(np.abs(step) / np.where(c.log, _LONGEST_STEP, np.maximum(1.0, np.abs(z))), initial=0.0))
    return np.asarray(np.clip(z + step / max(1.0, longest), c.low, c.high))


def _jacobian(
    bench: Bench,
    c: Coordinates,
    z: FloatArray,
    values: Values,
    here: FloatArray,
    length: float = _STEP,
    near: Fit | None = None,
) -> FloatArray:
    S, rate = np.empty((len(here), len(z))), c.rate(z)
    own = set(range(len(z)))
    if near is not None:
        for i, name in enumerate(c.names):
            if name in near.names:
                j = near.names.index(name)
                S[:, i] = near.jacobian[:, j] * (rate[i] / near.scale[j])
                own.remove(i)

    def changed(i: int) -> FloatArray:
        step = length if z[i] + length <= c.high[i] else -length
        moved = z.copy()
        moved[i] += step
        found = (bench.residual(c.to(moved, values)) - here) / step
        if not found.any():
            # what holds a cart at rest may change somewhat without any effect
            step = np.copysign(100.0 * _STEP, step)
            moved[i] = z[i] + step
            found = (bench.residual(c.to(moved, values)) - here) / step
        return np.asarray(found)

    for i, found in zip(own, bench.pool.map(changed, own), strict=True):
        S[:, i] = found
    return S

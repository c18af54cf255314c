r"""Joint refits: the present model and one candidate together, so that neither absorbs what belongs to the other.

Levenberg-Marquardt on the comparable residuals of the :mod:`workbench <identification.mismatch.workbench>`. Sensitivities
are finite differences large against the kinks of stick-slip. Positive parameters move as logarithms, all within bounds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import isfinite

import numpy as np

from flexdrive_gym.drive.effects import LAYOUT
from flexdrive_gym.drive.parameters import parameter
from flexdrive_gym.recording import FloatArray
from identification.mismatch.workbench import Workbench

_STEP = 2e-3


@dataclass(frozen=True, eq=False)
class Fit:
    """A model fitted on the workbench.

    Attributes
    ----------
    values
        The drive's parameters.
    names
        Those that were free.
    cost
        Sum of squares of the comparable residual.
    residual
        Comparable residual, shape (N,).
    jacobian
        Its sensitivity to the free parameters' coordinates, shape (N, names).
    """

    values: Mapping[str, float]
    names: tuple[str, ...]
    cost: float
    residual: FloatArray
    jacobian: FloatArray


class Coordinates:
    """Parameters as the optimiser sees them: logarithms of what is positive, the rest against a typical size."""

    def __init__(self, names: Sequence[str], start: Mapping[str, float]) -> None:
        self.names = tuple(names)
        self.log = np.array([_logarithmic(n) for n in self.names])
        self.scale = np.array([_scale(n, start) for n in self.names])
        low = np.array([parameter(n).lower for n in self.names])
        high = np.array([parameter(n).upper for n in self.names])
        with np.errstate(divide="ignore"):
            self.low = np.where(self.log, np.log(np.maximum(low, 1e-300)), low / self.scale)
            self.high = np.where(self.log, np.log(np.maximum(high, 1e-300)), high / self.scale)

    def of(self, values: Mapping[str, float]) -> FloatArray:
        """Return the coordinates of a drive."""
        x = np.array([values.get(n, parameter(n).null) for n in self.names])
        return np.asarray(np.where(self.log, np.log(np.maximum(x, 1e-300)), x / self.scale))

    def to(self, z: FloatArray, values: Mapping[str, float]) -> dict[str, float]:
        """Return the drive at coordinates z."""
        z = np.clip(z, self.low, self.high)
        x = np.where(self.log, np.exp(np.where(self.log, z, 0.0)), z * self.scale)
        return {**values, **{n: float(v) for n, v in zip(self.names, x, strict=True)}}


def _logarithmic(name: str) -> bool:
    if name in {"m1", "m2", "k"}:
        return True
    if name not in LAYOUT:
        return False
    q = LAYOUT[name].parameter
    return (q.role == "shape" and q.lower >= 0.0) or not isfinite(q.null)


def _scale(name: str, start: Mapping[str, float]) -> float:
    if name in LAYOUT and not LAYOUT[name].effect.base:
        return abs(LAYOUT[name].parameter.starts[0]) or 1.0
    same = [abs(v) for n, v in start.items() if n[0] == name[0] and len(n) == 2]
    if name in LAYOUT and (name not in {"b1", "b2", "d1", "d2"}):
        return abs(LAYOUT[name].parameter.starts[0]) or 1.0
    return max(abs(start.get(name, 0.0)), 0.05 * max(same, default=0.0), 1e-6)


def sensitivities(
    bench: Workbench, coordinates: Coordinates, z: FloatArray, values: Mapping[str, float], here: FloatArray
) -> FloatArray:
    """Return the derivative of the raw block residual with respect to the coordinates, shape (N, k) [mm/s]."""
    step = np.where(coordinates.log, _STEP, 5.0 * _STEP)
    # away from a bound
    step = np.where(z + step > coordinates.high, -step, step)
    shifted = []
    for i in range(len(z)):
        moved = z.copy()
        moved[i] += step[i]
        shifted.append(coordinates.to(moved, values))
    return (bench.residuals(shifted) - here[:, None]) / step


def refit(
    bench: Workbench,
    values: Mapping[str, float],
    names: Sequence[str],
    *,
    iterations: int = 8,
    fresh: Sequence[str] | None = None,
    known: tuple[Sequence[str], FloatArray] | None = None,
    tolerance: float = 1e-4,
) -> Fit:
    """Fit the named parameters, starting from ``values``.

    Parameters
    ----------
    fresh
        Parameters whose sensitivities are made anew in every iteration; default: all.
    known
        Names and comparable sensitivities to begin with for the others.
    """
    c = Coordinates(names, values)
    z = np.clip(c.of(values), c.low, c.high)
    now = c.to(z, values)
    raw = bench.residual(now)
    e = bench.comparable(raw)
    cost, damping = float(e @ e), 1e-3
    J = np.zeros((len(e), len(c.names)))
    moving = np.ones(len(c.names), dtype=bool)
    if known is not None:
        place = {n: i for i, n in enumerate(known[0])}
        for i, n in enumerate(c.names):
            if n in place:
                J[:, i] = known[1][:, place[n]]
                moving[i] = fresh is None or n in fresh
    for _ in range(iterations):
        own = np.flatnonzero(moving)
        part = Coordinates([c.names[i] for i in own], values)
        part.scale, part.low, part.high = c.scale[own], c.low[own], c.high[own]
        J[:, own] = bench.comparable(sensitivities(bench, part, z[own], now, raw))
        gradient, H = J.T @ e, J.T @ J
        better = False
        for _attempt in range(4):
            free = ~(((z <= c.low + 1e-12) & (gradient > 0)) | ((z >= c.high - 1e-12) & (gradient < 0)))
            step = np.zeros(len(z))
            A = H[np.ix_(free, free)]
            D = np.diag(np.maximum(np.diag(A), 1e-12 * max(float(np.trace(H)), 1e-300)))
            step[free] = -np.linalg.solve(A + damping * D, gradient[free])
            # a step much longer than the range in which finite differences mean anything is cut
            longest = float(np.max(np.abs(step / np.where(c.log, 0.7, np.maximum(2.0, 2.0 * np.abs(z))))))
            new = np.clip(z + step / max(1.0, longest), c.low, c.high)
            trial = c.to(new, values)
            raw_new = bench.residual(trial)
            e_new = bench.comparable(raw_new)
            cost_new = float(e_new @ e_new)
            if cost_new < cost:
                better = True
                break
            damping = max(damping, 1e-3) * 10.0
        if not better:
            break
        gained, z, now, raw, e, cost = cost - cost_new, new, trial, raw_new, e_new, cost_new
        damping = max(damping * 0.2, 1e-6)
        if gained < tolerance * cost:
            break
    return Fit(now, c.names, cost, e, J)


def with_fresh_jacobian(bench: Workbench, fit: Fit) -> Fit:
    """Return the fit with all sensitivities made anew at its end."""
    c = Coordinates(fit.names, fit.values)
    raw = bench.residual(fit.values)
    return replace(fit, jacobian=bench.comparable(sensitivities(bench, c, c.of(fit.values), fit.values, raw)))

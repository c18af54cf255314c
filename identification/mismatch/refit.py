r"""Joint refits: the present model and one candidate together, so that neither absorbs what belongs to the other.

Levenberg-Marquardt on the weighted residuals of the :mod:`workbench <identification.mismatch.workbench>`. Sensitivities are
finite differences large against the kinks of stick-slip; where all parameters are free they are carried along small
steps while these succeed, and made anew before the fit ends. Positive parameters move as logarithms, all within bounds. What the
fit is worth is judged by its comparable residual, after a last linear step of all but its shapes, for what is best among
weighted residuals is not quite best among these.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import isfinite

import numpy as np

from flexdrive_gym.drive.effects import LAYOUT
from flexdrive_gym.drive.parameters import fastest, parameter
from flexdrive_gym.recording import FloatArray
from identification.mismatch.workbench import View, Workbench
from identification.replay.output_error import PHYSICS_S

_STEP = 2e-3
# factors of the step where a parameter does nothing within it
_LONGER = (1.0, 10.0, 100.0)
# a step that gains more than this share went too far for sensitivities to be carried along it
_FAR = 0.05
# rate of an effect, times a step of the physics, beyond which it is not followed
_FINEST = 50.0


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
        Sum of squares of the comparable residual after its linear step.
    weighted
        Sum of squares of the weighted residual, which the fit minimised.
    residual
        The comparable residual, shape (N,).
    minimised
        The weighted residual, shape (N,).
    sensitivity
        Of the raw block residual to the free parameters' coordinates, shape (N, names) [mm/s].
    jacobian
        The same, comparable.
    """

    values: Mapping[str, float]
    names: tuple[str, ...]
    cost: float
    weighted: float
    residual: FloatArray
    minimised: FloatArray
    sensitivity: FloatArray
    jacobian: FloatArray

    def seen(self, view: View) -> FloatArray:
        """Return the residual in a view, shape (N,)."""
        return self.residual if view == "comparable" else self.minimised

    def bare(self) -> Fit:
        """Return the fit without its sensitivities, which are most of what it holds."""
        nothing = np.zeros((0, len(self.names)))
        return replace(self, sensitivity=nothing, jacobian=nothing)

    def beside(self, other: Fit, view: View) -> float:
        """Return the share of another fit's squared error in a view that this one is rid of."""
        mine, its = (float(np.sum(f.seen(view) ** 2)) for f in (self, other))
        return 1.0 - mine / its


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
    """Return the derivative of the raw block residual with respect to the coordinates, shape (N, k) [mm/s].

    What holds a cart at rest may be somewhat more or less without any change; the slope is then taken over a longer step.
    """
    S = np.zeros((len(here), len(z)))
    columns = list(range(len(z)))
    for longer in _LONGER:
        step = longer * np.where(coordinates.log, _STEP, 5.0 * _STEP)
        # away from a bound
        step = np.where(z + step > coordinates.high, -step, step)
        shifted = []
        for i in columns:
            moved = z.copy()
            moved[i] += step[i]
            shifted.append(coordinates.to(moved, values))
        S[:, columns] = (bench.residuals(shifted) - here[:, None]) / step[columns]
        columns = [i for i in columns if not S[:, i].any() and _holds(coordinates.names[i])]
        if not columns:
            break
    return S


def _holds(name: str) -> bool:
    """Whether a parameter is the size of what holds a cart at rest."""
    return name in LAYOUT and LAYOUT[name].parameter.role == "size" and "breakaway" in LAYOUT[name].effect.hooks


def refit(
    bench: Workbench,
    values: Mapping[str, float],
    names: Sequence[str],
    *,
    iterations: int = 8,
    fresh: Sequence[str] | None = None,
    known: Fit | None = None,
    tolerance: float = 1e-4,
    view: View = "weighted",
    rough: bool = False,
) -> Fit:
    """Fit the named parameters, starting from ``values``.

    Parameters
    ----------
    fresh
        Parameters whose sensitivities are made anew in every iteration; default: all.
    known
        A fit of some of these parameters, whose sensitivities serve for the others.
    view
        In which the squared error is made least.
    rough
        Whether it is enough to come near: then sensitivities need not be made anew before the fit ends.
    """
    c = Coordinates(names, values)
    z = np.clip(c.of(values), c.low, c.high)
    now = c.to(z, values)
    raw = bench.residual(now)
    e = bench.seen(view, raw)
    cost, damping = float(e @ e), 1e-3
    S = np.zeros((len(e), len(c.names)))
    moving = np.ones(len(c.names), dtype=bool)
    if known is not None:
        place = {n: i for i, n in enumerate(known.names)}
        for i, n in enumerate(c.names):
            if n in place:
                S[:, i] = known.sensitivity[:, place[n]]
                moving[i] = fresh is None or n in fresh
    own, kept = np.flatnonzero(moving), np.flatnonzero(~moving)
    J = np.zeros_like(S)
    comparable = (
        np.zeros((len(e), len(kept))) if known is None else known.jacobian[:, [place[c.names[i]] for i in kept]]
    )
    J[:, kept] = comparable if view == "comparable" else bench.weighted(S[:, kept])
    part = Coordinates([c.names[i] for i in own], values)
    part.scale, part.low, part.high = c.scale[own], c.low[own], c.high[own]
    renew = True
    for _ in range(iterations):
        if renew:
            S[:, own] = sensitivities(bench, part, z[own], now, raw)
            J[:, own] = bench.seen(view, S[:, own])
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
            if fastest(trial)[0] * PHYSICS_S > _FINEST:
                # what is so fast is as good as instantaneous, and would be simulated for hours
                damping = max(damping, 1e-3) * 10.0
                continue
            raw_new = bench.residual(trial)
            e_new = bench.seen(view, raw_new)
            cost_new = float(e_new @ e_new)
            if cost_new < cost:
                better = True
                break
            damping = max(damping, 1e-3) * 10.0
        if not better and renew:
            break
        if not better:
            renew, damping = True, 1e-3
            continue
        if known is None:
            # what stays at an infinite null does not move
            _carry(bench, S, J, view, np.subtract(new, z, out=np.zeros(len(z)), where=new != z), raw_new - raw)
        gained, z, now, raw, e, cost = cost - cost_new, new, trial, raw_new, e_new, cost_new
        damping = max(damping * 0.2, 1e-6)
        done = gained < tolerance * cost
        if done and (renew or rough):
            break
        renew = done or known is not None or gained > _FAR * cost
    if view != "comparable":
        J[:, kept], J[:, own] = comparable, bench.comparable(S[:, own])
    return judged(bench, c, z, now, raw, S, J)


def _carry(bench: Workbench, S: FloatArray, J: FloatArray, view: View, step: FloatArray, change: FloatArray) -> None:
    """Carry sensitivities along a step so that they explain what it changed (C. G. Broyden, Math. Comp. 19, 1965)."""
    square = float(step @ step)
    if square > 0.0:
        lacking, along = change - S @ step, step / square
        S += np.outer(lacking, along)
        J += np.outer(bench.seen(view, lacking), along)


def judged(
    bench: Workbench,
    c: Coordinates,
    z: FloatArray,
    values: Mapping[str, float],
    raw: FloatArray,
    sensitivity: FloatArray,
    jacobian: FloatArray | None = None,
) -> Fit:
    """Return a fit with what it is worth: its comparable residual after a linear step within the bounds.

    ``jacobian`` is the comparable sensitivity, where it is known already.
    """
    e = bench.comparable(raw)
    J = bench.comparable(sensitivity) if jacobian is None else jacobian
    use = np.array([not _is_shape(n) for n in c.names]) & (np.sum(J**2, axis=0) > 0.0)
    while use.any():
        step, *_ = np.linalg.lstsq(J[:, use], -e, rcond=1e-8)
        new = z[use] + step
        out = (new < c.low[use] - 1e-12) | (new > c.high[use] + 1e-12)
        if not out.any():
            e = e + J[:, use] @ step
            break
        use[np.flatnonzero(use)[out]] = False
    plain = bench.weighted(raw)
    return Fit(values, c.names, float(e @ e), float(plain @ plain), e, plain, sensitivity, J)


def _is_shape(name: str) -> bool:
    return name in LAYOUT and (LAYOUT[name].parameter.role == "shape" or not isfinite(LAYOUT[name].parameter.null))


def with_fresh_sensitivity(bench: Workbench, values: Mapping[str, float], names: Sequence[str]) -> Fit:
    """Return a model as a fit of the named parameters that ended where it is, with all sensitivities made anew."""
    c = Coordinates(names, values)
    z, raw = c.of(values), bench.residual(values)
    return judged(bench, c, z, values, raw, sensitivities(bench, c, z, values, raw))

"""What gains like an effect and has no name: a free function, its shape, and the names nearest to it."""

from __future__ import annotations

import numpy as np

from identification.diagnosis.bench import Bench
from identification.diagnosis.candidates.free import Shape
from identification.diagnosis.score import Normal
from identification.diagnosis.select import Round, Scored, Selection
from identification.diagnosis.verdict import Curve, Unnamed

_WORDS = {
    "velocity 1": ("the velocity of cart 1", "mm/s"),
    "velocity 2": ("the velocity of cart 2", "mm/s"),
    "deflection": ("the deflection of the spring", "mm"),
    "command": ("the command", "V"),
    "time": ("time", "s"),
}
_NEAREST = 3


def share_of(scored: Scored, step: Round) -> float:
    """Return the share of the whitened square left before a round that a candidate explains."""
    return float(min(1.0, 2.0 * scored.total / max(float(step.base.normal.square.sum()), 1e-300)))


def unnamed(bench: Bench, selection: Selection) -> Unnamed | None:
    """Return what was accepted last if it has no name."""
    last = selection.rounds[-1]
    shape = last.best.candidate
    if not last.accepted or not isinstance(shape, Shape):
        return None
    near = [s for s in last.scored[1:] if not isinstance(s.candidate, Shape) and s.total > 0.0]
    nearest = tuple((s.name[0], float(min(1.0, s.total / last.best.total))) for s in near[:_NEAREST])
    follows, _ = _WORDS.get(shape.variable, (shape.variable, ""))
    return Unnamed(
        shape.where, share_of(last.best, last), f"as a function of {follows}", nearest, _curve(bench, last, shape)
    )


def _curve(bench: Bench, last: Round, shape: Shape) -> Curve:
    """Return the force at every knot, with the standard error of the jackknife."""
    base, noise = last.base, last.noise
    pushed = bench.pushed(base.values, shape.forces, shape.size)
    white = noise.white(np.column_stack([base.jacobian[:, base.interior], *pushed]))
    n = Normal.of(bench.products(np.column_stack([white, noise.residual(base.residual)])))
    knots, damping = slice(white.shape[1] - len(shape.at), None), bench.settings.damping
    own = n.steps(damping)[:, knots]
    U = len(own)
    band = np.sqrt((U - 1.0) / U * np.sum((own - own.mean(axis=0)) ** 2, axis=0))
    follows, unit = _WORDS.get(shape.variable, (shape.variable, ""))
    return Curve(follows, unit, shape.at, n.solve(damping)[knots], band)

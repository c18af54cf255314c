"""What gains like an effect and has no name: a free function, its shape, and the names nearest to it."""

from __future__ import annotations

import numpy as np

from identification.diagnosis.candidates.catalogue import Candidate
from identification.diagnosis.candidates.free import Shape
from identification.diagnosis.score import Normal
from identification.diagnosis.select import Round, Selection
from identification.diagnosis.verdict import Curve, Unnamed

_WORDS = {
    "velocity 1": ("the velocity of cart 1", "mm/s"),
    "velocity 2": ("the velocity of cart 2", "mm/s"),
    "deflection": ("the deflection of the spring", "mm"),
    "command": ("the command", "V"),
    "time": ("time", "s"),
}
_NEAREST = 3


def unnamed(selection: Selection) -> Unnamed | None:
    """Return what was accepted last if it has no name."""
    last = selection.rounds[-1]
    shape = last.best.candidate
    if not last.accepted or isinstance(shape, Candidate):
        return None
    white = float(np.sum(last.base.normal.square))
    share = min(1.0, 2.0 * last.best.total / max(white, 1e-300))
    near = [s for s in last.scored[1:] if isinstance(s.candidate, Candidate) and s.total > 0.0]
    nearest = tuple((s.name[0], float(min(1.0, s.total / last.best.total))) for s in near[:_NEAREST])
    follows, _ = _WORDS.get(shape.variable, (shape.variable, ""))
    return Unnamed(shape.where, share, f"as a function of {follows}", nearest, _curve(last, shape))


def _curve(last: Round, shape: Shape) -> Curve | None:
    """Return the force at every knot, with the standard error of the jackknife over recordings."""
    columns = next((e.columns for e in last.linear.entries if e.candidate is shape), ())
    if len(columns) != len(shape.at):
        # a knot that no recording reaches has no column
        return None
    n = last.linear.normal(columns)
    size = slice(len(last.linear.base), None)
    R = len(n.square)
    own = np.array([_without(n, r, last.noise.ridge)[size] for r in range(R)])
    band = np.sqrt((R - 1.0) / R * np.sum((own - own.mean(axis=0)) ** 2, axis=0))
    follows, unit = _WORDS.get(shape.variable, (shape.variable, ""))
    return Curve(follows, unit, shape.at, n.solve(last.noise.ridge)[size], band)


def _without(n: Normal, r: int, ridge: float) -> np.ndarray:
    H, g = n.information.sum(axis=0) - n.information[r], n.gradient.sum(axis=0) - n.gradient[r]
    return n.step(H, g, ridge)

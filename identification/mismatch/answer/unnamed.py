"""What gains like an effect and has no name: a free function, its shape, and the names nearest to it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identification.mismatch.answer.finding import Curve, Named, Unnamed, phrase
from identification.mismatch.candidates.catalogue import Candidate
from identification.mismatch.candidates.free import FOLLOWS, Shape
from identification.mismatch.candidates.narrow_band import Line
from identification.mismatch.fitting.bench import Bench
from identification.mismatch.fitting.score import Normal
from identification.mismatch.selection.ranking import Round, Scored
from identification.mismatch.selection.selector import Selection

_NEAREST = 3


def share_of(scored: Scored, step: Round) -> float:
    """Return the share of the whitened square left before a round that a candidate explains."""
    return float(min(1.0, 2.0 * scored.total / max(float(step.base.normal.square.sum()), 1e-300)))


def unnamed(bench: Bench, selection: Selection, *, named: bool) -> Unnamed | None:
    """Return what was accepted last if it has no name, or what is significant and given none.

    Parameters
    ----------
    named
        Whether anything is. If not, what is significant is an effect whose name is none of those that were tried: these predict
        milliseconds, and no simulation needs them.
    """
    first, last = selection.rounds[0], selection.rounds[-1]
    if last.accepted and isinstance(last.best.candidate, Shape | Line):
        return _free(bench, last, last.best.candidate)
    if selection.differing:
        return _differing(*selection.differing[0])
    if named or not first.accepted:
        return None
    shape = first.best.candidate
    return (
        _free(bench, first, shape) if isinstance(shape, Shape | Line) else _like(first, tried=bool(selection.accepted))
    )


def _free(bench: Bench, step: Round, shape: Shape | Line) -> Unnamed:
    nearest, share = _nearest(step.scored[1:], step.best.total), share_of(step.best, step)
    if isinstance(shape, Line):
        return Unnamed(shape.where, share, f"of {shape.frequency:.3g} Hz that the command does not make", nearest)
    follows, _ = FOLLOWS.get(shape.variable, (shape.variable, ""))
    return Unnamed(shape.where, share, f"as a function of {follows}", nearest, _curve(bench, step, shape))


def _like(step: Round, *, tried: bool) -> Unnamed:
    """Return what is nearest to an effect that no name describes, ``tried`` in the simulation that fits best or not."""
    best, relevant = step.best, step.base.bench.settings.relevant
    if tried:
        why = "the simulation that fits best does without"
    elif isinstance(best.candidate, Candidate):
        why = "brings recordings that are left out no nearer"
    else:
        why = f"takes less than {relevant:.0%} off the squared error of a simulation"
    text = f"most like {phrase(best.name[0])}, which {why}"
    return Unnamed(best.name[1], share_of(best, step), text, _nearest(step.scored, best.total))


def _differing(scored: Scored, step: Round) -> Unnamed:
    """Return what does as an effect with another size in every experiment would."""
    text = f"like {phrase(scored.name[0])}, but with a size that differs between experiments"
    return Unnamed(scored.name[1], share_of(scored, step), text, _nearest(step.scored, scored.total))


def _nearest(scored: Sequence[Scored], total: float) -> tuple[tuple[Named, float], ...]:
    near = [s for s in scored if not isinstance(s.candidate, Shape | Line) and s.total > 0.0]
    return tuple((Named(*s.name), float(min(1.0, s.total / total))) for s in near[:_NEAREST])


def _curve(bench: Bench, last: Round, shape: Shape) -> Curve:
    """Return the force at every knot, with the standard error of the jackknife."""
    base, noise = last.base, last.noise
    pushed = bench.pushed(base.values, shape.forces, shape.size)
    white = noise.white(np.column_stack([base.jacobian[:, base.interior], *pushed]))
    n = Normal.of(bench.products(np.column_stack([white, noise.white(base.residual)])))
    knots, damping = slice(white.shape[1] - len(shape.at), None), bench.settings.damping
    own = n.steps(damping)[:, knots]
    U = len(own)
    band = np.sqrt((U - 1.0) / U * np.sum((own - own.mean(axis=0)) ** 2, axis=0))
    follows, unit = FOLLOWS.get(shape.variable, (shape.variable, ""))
    return Curve(follows, unit, shape.at, n.solve(damping)[knots], band)

"""Output error: rows weighted by the level of error of their recording and cart, which judge long horizons.

Names are selected by prediction errors, which tell laws apart within milliseconds. A drive that lacks something predicts well
with friction that simulates badly, so the drives that a diagnosis reports, and predicts from, are fitted once more by output
error.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from identification.mismatch.candidates.catalogue import Candidate
from identification.mismatch.fitting.bench import Bench, Values
from identification.mismatch.fitting.fit import Fit, Metric, fit
from identification.mismatch.fitting.levels import Levels
from identification.mismatch.fitting.score import bounded
from identification.mismatch.selection.optima import without
from identification.mismatch.selection.ranking import Scored
from identification.mismatch.selection.start import hiding_starts
from identification.mismatch.settings import Settings

# of weights: errors that levels are taken from are those of a fit with the levels before
_ROUNDS = 2


def output_error(bench: Bench, near: Fit, *others: Fit, candidates: Sequence[Candidate] = ()) -> Fit:
    """Return the optimum of the output error from another optimum of the same parameters.

    Parameters
    ----------
    others
        Models that it is to be held against: their levels count, too, and their parameters are another start.
    candidates
        Effects that it has: those that dry friction hides are fitted from their own starts, too.
    """
    best, more = near, restarts(bench, near, candidates)
    for _ in range(_ROUNDS):
        levels = Levels.of(bench, best.residual, *(o.residual for o in others))
        starts = [best.values, *({**best.values, **o.values} for o in others), *more]
        best = min(bench.pool.map(partial(held_first, bench, levels, names=near.names), starts), key=lambda f: f.cost)
    return best


def restarts(bench: Bench, near: Fit, candidates: Sequence[Candidate]) -> list[Values]:
    """Return other starts of a fit that has effects which dry friction hides, from the friction that the two share.

    Below breakaway nothing slides, and no slope leads from one share, or one length of bristles, to another.
    """
    plain = [n for n in near.names if "." not in n]
    own = (c for c in candidates if c.takes and all(k in near.names for k in c.keys))
    return [start for c in own for _, start in hiding_starts(bench, c, without(c, near.values, plain))]


def held_first(bench: Bench, metric: Metric, start: Values, names: Sequence[str]) -> Fit:
    """Fit from a start, first the base parameters alone: a gap that friction of the wrong size has closed stays closed."""
    plain = [n for n in names if "." not in n]
    held = fit(bench, metric, start, plain).values if 0 < len(plain) < len(names) else start
    return fit(bench, metric, held, names)


def share_of_error(scored: Scored, best: Fit) -> float:
    """Return the share of the squared output error, of rows or of the deflection, that an effect takes off beside all others.

    Milliseconds tell laws apart, and tell of what no simulation needs, too: ripples of a contact whose law is another. An encoder
    whose scale is off by one in a hundred changes velocities as little, and a deflection after a long way as much as the spring.
    Friction that differs from run to run makes errors that last as long as a recording, so one parameter more takes some per cent
    off anyway: what brings recordings no nearer that are left out, takes off nothing.

    Parameters
    ----------
    scored
        The effect. One with a phase of its own in every recording is in no simulation: what it takes off is what its amplitude
        makes.
    best
        The drive with it, at the optimum of its own metric.
    """
    candidate = scored.candidate
    if not isinstance(candidate, Candidate):
        made = best.metric.white(np.column_stack([d.size * d.change for d in scored.variability]))
        return float(np.sum(made**2)) / max(best.cost, 1e-300)
    names = [n for n in best.names if n not in candidate.keys]
    less = fit(best.bench, best.metric, without(candidate, best.values, names), names)
    own = 1.0 - best.cost / max(less.cost, 1e-300) if _left_out(less, best) > 0.0 else 0.0
    without_it = _deflection(less)
    of_deflection = 1.0 - _deflection(best) / without_it if without_it > 0.0 else 0.0
    return max(own, of_deflection) if of_deflection >= best.bench.settings.relevant_deflection else own


def needed(scored: Scored, share: float, *, first: bool, settings: Settings) -> bool:
    """Whether a simulation needs a name that takes a share off the squared output error.

    The first, which gains most of all, brings experiments nearer that are left out. No law is exact, so what follows it may be
    what it does not describe, and a ripple is in no simulation: these must take off what no chance does.
    """
    return share > 0.0 if first and isinstance(scored.candidate, Candidate) else share >= settings.relevant


def _left_out(less: Fit, best: Fit) -> float:
    """Return what an effect takes off the squares of experiments that are left out, each within what the others let expect."""
    bench, damping = best.bench, best.bench.settings.damping
    change = bench.sums(best.metric.white(less.residual - best.residual)[:, None] ** 2)[:, 0]
    return float(bounded(less.normal.left_out(damping) - best.normal.left_out(damping), change).sum())


def _deflection(model: Fit) -> float:
    """Return the squared error of the deflection over recordings of two velocities without a gap [mm²]; 0 where there is none."""
    bench, total = model.bench, 0.0
    for run, rows in zip(bench.runs, bench.rows, strict=True):
        if not run.positions and len(run.keep) == 2 and bench.valid[rows].all():
            v = model.residual[rows].reshape(2, -1)
            error = np.cumsum(v[0] - v[1]) * run.block * run.sample_time
            total += float(error @ error)
    return total

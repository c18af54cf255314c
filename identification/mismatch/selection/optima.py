"""Optima of the base model and of candidates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from flexdrive_gym.drive.parameters import parameter
from identification.mismatch.candidates.catalogue import Candidate, look_alikes
from identification.mismatch.fitting.bench import Bench, Values
from identification.mismatch.fitting.fit import Fit, Metric, fit, gain_of, resolved
from identification.mismatch.fitting.levels import Levels
from identification.mismatch.noise.estimate import Noise, first_noise
from identification.mismatch.selection.evaluate import Name
from identification.mismatch.selection.ranking import Scored, tied
from identification.mismatch.selection.start import Start, base_starts
from identification.topology import Topology

# log-likelihood that another optimum must gain: of as many parameters, more than chance
WORTH = 2.0
# iterations of a first try from every start, and the share of a start's sizes that a second one has
_TRY = 4
_SMALL = 0.1
# first tries of the candidate that is ahead that are carried to the end
_ENDS = 2
# finite difference that sees over rests and slips, in scaled coordinates
_LONG = 0.05
# share of an effect that stands for its derivative
_LITTLE = 0.1


def fit_base(bench: Bench, topology: Topology, known: Values) -> Fit:
    """Fit the base model from every start there is."""
    names = [*topology.free, *known]
    starts = base_starts(bench, topology)
    noise = first_noise(bench, starts[0])
    tries = bench.pool.map(lambda values: fit(bench, noise, {**values, **known}, names, iterations=_TRY), starts)
    best = sorted(tries, key=lambda f: f.cost)[:2]
    return min((fit(bench, noise, f.values, f.names) for f in best), key=lambda f: f.cost)


def far(base: Fit) -> bool:
    """Whether the simulation is so far from the data that its own sensitivities may lead nowhere."""
    bench = base.bench
    errors = [
        float(np.mean(base.residual[p.rows][bench.valid[p.rows]] ** 2))
        for p in bench.pieces
        if bench.valid[p.rows].any()
    ]
    seen = [s for p, s in zip(bench.pieces, bench.signal, strict=True) if bench.valid[p.rows].any()]
    return bool(sum(errors) > bench.settings.far * sum(seen))


def fit_candidates(
    base: Fit, noise: Metric, jobs: Sequence[tuple[Candidate, Values]], *, enough: float = np.inf
) -> dict[Name, tuple[Candidate, Fit]]:
    """Fit candidates, each from all its starts that a simulation resolves.

    Parameters
    ----------
    enough
        Decrease of the cost by the candidate that is ahead from which on the others are left where a first try ended: noise that
        is told without it is not what they are to be judged by.
    """
    bench = base.bench
    tried = _tried(base, noise, jobs)
    best = {name: tries[0] for name, tries in tried.items()}
    if not far(base) and best:
        white = noise.white(base.residual)
        first = min(best, key=lambda n: best[n][1].cost)
        # one optimum is not the only one, and all that follows is around it
        ends = bench.pool.map(lambda item: (item[0], _at_optimum(noise, item[1])), tried[first])
        best[first] = min(ends, key=lambda item: item[1].cost)
        if float(white @ white) - best[first][1].cost > enough:
            return best
    # those that are ahead, and those that the linear change puts first, however far their fits have to go
    asked = list(dict.fromkeys(candidate.name for candidate, _ in jobs if candidate.name in best))
    ahead = sorted(best, key=lambda n: best[n][1].cost)[: bench.settings.finished]
    leading = list(dict.fromkeys([*ahead, *asked[: bench.settings.finished // 2]]))
    ended = _ended(base, noise, {n: best[n] for n in leading})
    far_sighted = bench.pool.map(partial(_through_output_error, noise), [own for _, own in ended.values()])
    return best | {n: (candidate, own) for (n, (candidate, _)), own in zip(ended.items(), far_sighted, strict=True)}


def refined(base: Fit, noise: Metric, fits: Mapping[Name, tuple[Candidate, Fit]]) -> dict[Name, tuple[Candidate, Fit]]:
    """Return fits of candidates, the one that is ahead with all its parameters."""
    if not fits:
        return {}
    candidate, own = min(fits.values(), key=lambda item: item[1].cost)
    whole = replace(candidate, shapes=(*candidate.shapes, *candidate.finer), finer=())
    jobs = [(whole, {**own.values, **dict(candidate.finer)})] if candidate.finer else []
    return nearest(fits, fit_candidates(base, noise, jobs))


def contained(base: Fit, model: Fit, candidates: Sequence[Candidate]) -> list[Start]:
    """Return the candidates that a model has beside the base model's parameters, each as it has it."""
    own = {c.keys: c for c in candidates if all(k in model.values and k not in base.values for k in c.keys)}
    return [(c, {k: v for k, v in model.values.items() if k in base.values or k in keys}) for keys, c in own.items()]


def nearest(
    fits: Mapping[Name, tuple[Candidate, Fit]], others: Mapping[Name, tuple[Candidate, Fit]]
) -> dict[Name, tuple[Candidate, Fit]]:
    """Return every candidate's better one of two fits."""
    return {**fits, **{n: own for n, own in others.items() if n not in fits or own[1].cost < fits[n][1].cost}}


def _tried(
    base: Fit, noise: Metric, jobs: Sequence[tuple[Candidate, Values]]
) -> dict[Name, list[tuple[Candidate, Fit]]]:
    """Return the best first tries of every candidate, the best one first."""
    bench = base.bench
    jobs = [job for job in jobs if resolved(job[1])]
    white = noise.white(base.residual)
    contained = float(white @ white)

    def tried(job: tuple[Candidate, Values]) -> tuple[Candidate, Fit]:
        candidate, start = job
        names = (*base.names, *candidate.keys)
        found = fit(bench, noise, start, names, iterations=_TRY, near=base)
        if found.cost > contained:
            # no optimum is worse than that of the model it contains: a drive that friction holds has no slope that leads back
            small = {**start, **{k: _SMALL * start[k] for k, _ in candidate.sizes}}
            if resolved(small):
                found = min(found, fit(bench, noise, small, names, iterations=_TRY, near=base), key=lambda f: f.cost)
        return candidate, found

    tries: dict[Name, list[tuple[Candidate, Fit]]] = {}
    for candidate, found in bench.pool.map(tried, jobs):
        own = tries.setdefault(candidate.name, [])
        own.append((candidate, found))
        own.sort(key=lambda item: item[1].cost)
        # a fit has derivatives of all rows
        del own[_ENDS:]
    return tries


def _ended(base: Fit, noise: Metric, best: Mapping[Name, tuple[Candidate, Fit]]) -> dict[Name, tuple[Candidate, Fit]]:
    """Carry fits to the end: the leader's first, then the others', from their own or its base parameters, whichever are nearer.

    None may win by its basin, and a valley of the base model is gone down once, not by everyone.
    """
    bench, found = base.bench, dict(best)
    ended = partial(_at_optimum, noise)

    def beside(leader: Candidate, there: Fit, item: tuple[Candidate, Fit]) -> tuple[Candidate, Fit]:
        candidate, own = item
        values = without(leader, there.values, base.names) | {k: own.values[k] for k in candidate.keys}
        if resolved(values):
            other = fit(bench, noise, values, own.names, iterations=_TRY)
            if other.cost < own.cost:
                return candidate, ended(other)
        return candidate, ended(own)

    if far(base):
        # every start leads elsewhere
        found = {c.name: (c, f) for c, f in bench.pool.map(lambda item: (item[0], ended(item[1])), found.values())}
    asked = set[Name]()
    # a second time where another has come ahead
    while len(asked) < min(2, len(found)):
        ahead = min(found, key=lambda n: found[n][1].cost)
        if ahead in asked:
            break
        asked.add(ahead)
        leader, there = found[ahead][0], ended(found[ahead][1])
        found[ahead] = leader, there
        rest = [item for n, item in found.items() if n not in asked]
        found |= {c.name: (c, f) for c, f in bench.pool.map(partial(beside, leader, there), rest)}
    return found


def _at_optimum(noise: Metric, own: Fit) -> Fit:
    return own if own.known is not None else fit(own.bench, noise, own.values, own.names, near=own)


def _through_output_error(noise: Metric, own: Fit) -> Fit:
    """Return the better one of an optimum and of that which some steps towards the optimum of the output error lead to.

    Unknown forces excuse what adds up over a long time, and near rest the likelihood is rough: friction of the wrong size stays,
    and a constant force comes out small. The output error excuses nothing, and long differences see over what is rough.
    """
    seen = fit(own.bench, Levels.of(own.bench, own.residual), own.values, own.names, iterations=2 * _TRY, step=_LONG)
    other = fit(own.bench, noise, seen.values, own.names, iterations=_TRY)
    return _at_optimum(noise, other) if other.cost < own.cost else own


def refit_base(base: Fit, noise: Noise, fits: Sequence[tuple[Candidate, Fit]]) -> Fit:
    """Refit the base model from candidates' optima: a better optimum of it must not pass for a gain."""

    def one(item: tuple[Candidate, Fit]) -> Fit:
        candidate, best = item
        return fit(base.bench, noise, without(candidate, best.values, base.names), base.names, near=base)

    best = min(base.bench.pool.map(one, fits), key=lambda f: f.cost, default=base)
    return best if best.cost < base.cost - WORTH else base


def carried_over(
    before: Fit, base: Fit, noise: Noise, fits: Mapping[Name, tuple[Candidate, Fit]]
) -> dict[Name, tuple[Candidate, Fit]]:
    """Return fits beside a better optimum of the base model: what stayed in the valley that it left begins anew from there."""
    behind = [] if base is before else [(c, f) for c, f in fits.values() if f.cost >= base.cost]
    jobs = [(c, c.beside(base.values, {k: f.values[k] for k in c.keys})) for c, f in behind]
    return nearest(fits, fit_candidates(base, noise, jobs)) if jobs else dict(fits)


def imitating(base: Fit, noise: Noise, candidates: Sequence[Candidate], leader: Candidate, there: Fit) -> list[Start]:
    """Return the look-alikes of a candidate beside its base parameters, as large as they must be to do what it does.

    Two names for one force have one optimum, which a fit from elsewhere need not reach. What one must be to stand for a little of
    the other is told around the drive with that one, where both are what they are.

    Parameters
    ----------
    candidates
        All of them, in all shapes.
    leader, there
        The candidate that looks like others, and the drive with it.
    """
    names = look_alikes(leader.id)
    alike = [
        c
        for c in candidates
        if c.id in names
        and c.proportional
        and not any(k in there.values for k, _ in c.sizes)
        and resolved({**there.values, **c.start})
    ]
    if not leader.proportional or not alike:
        return []
    less = {k: there.values[k] - _LITTLE * (there.values[k] - parameter(k).null) for k, _ in leader.sizes}
    more = [c.one(i) | {k: _LITTLE * v for k, v in c.sizes[i : i + 1]} for c in alike for i in range(len(c.sizes))]
    moved = base.bench.residuals([{**there.values, **own} for own in (less, *more)])
    done, *columns = noise.white((np.column_stack(moved) - there.residual[:, None]) / _LITTLE).T
    values, best = without(leader, there.values, base.names), dict[Name, tuple[float, Start]]()
    at = iter(columns)
    for candidate in alike:
        # columns are of the usual sizes, and what the leader does is the change from less of it
        own = np.column_stack([next(at) for _ in candidate.sizes])
        sizes, *_ = np.linalg.lstsq(own, -done, rcond=None)
        left = float(np.sum((done + own @ sizes) ** 2))
        start = dict(candidate.shapes)
        for (key, usual), size in zip(candidate.sizes, sizes, strict=True):
            start[key] = float(np.clip(size * usual, parameter(key).lower, parameter(key).upper))
        if candidate.name not in best or left < best[candidate.name][0]:
            best[candidate.name] = left, (candidate, {**values, **start})
    return [start for _, start in best.values()]


def pruned(base: Fit, noise: Noise, scored: Sequence[Scored], significant: Sequence[Scored]) -> list[Scored]:
    """Return candidates where the best one has no more sizes than it needs: one that predicts as well alone is enough."""
    best = max(significant, key=lambda s: s.total, default=None)
    if best is None or best.fit is None or not isinstance(best.candidate, Candidate):
        return list(scored)
    whole = best.candidate
    if len(whole.sizes) < 2 or any(k.rsplit(".", 1)[-1] == "a_sin" for k, _ in whole.sizes):
        return list(scored)
    for size in whole.sizes:
        part = replace(whole, sizes=(size,))
        start = {k: v for k, v in best.fit.values.items() if k in part.keys or k not in whole.keys}
        smaller = fit(base.bench, noise, start, (*base.names, *part.keys))
        own = replace(best, candidate=part, fit=smaller, gain=gain_of(base, smaller), size=len(part.keys))
        if tied(best, own):
            return [own if s is best else s for s in scored]
    return list(scored)


def without(candidate: Candidate, values: Values, names: Sequence[str]) -> dict[str, float]:
    """Return a drive without a candidate, whose base parameters get back what it had taken over, where the model has these."""
    left = {k: v for k, v in values.items() if k not in candidate.keys}
    for key, taken in (*candidate.takes, *candidate.parts):
        if taken in names:
            left[taken] = left.get(taken, 0.0) + values.get(key, 0.0)
    return left

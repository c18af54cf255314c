"""Forward selection of effects, then backward: which candidates improve the prediction of other recordings beyond the null."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from flexdrive_gym.drive.parameters import parameter
from flexdrive_gym.recording import FloatArray
from identification.diagnosis.bench import Bench, Values
from identification.diagnosis.candidates.catalogue import Candidate, catalogue, look_alikes, null_value
from identification.diagnosis.candidates.free import Shape, shapes
from identification.diagnosis.fit import Fit, fit
from identification.diagnosis.linear import Entry, Linear, linearise
from identification.diagnosis.noise import Noise, estimate, first_noise
from identification.diagnosis.nuisance import Direction, directions, dry_level
from identification.diagnosis.null import Name, Null, null_of
from identification.diagnosis.score import gains, studentised, trimmed
from identification.diagnosis.screen import Proposal, Screen
from identification.equation_error import start_values
from identification.topology import Topology

Say = Callable[[str], None]
# iterations of a first try from every start
_TRY = 4
# paired t under which two candidates predict alike
TIE = 2.0
# share of a gain that is no difference between two candidates
NEGLIGIBLE = 0.01


@dataclass(frozen=True, eq=False)
class Scored:
    """A candidate at its optimum, with its score in every recording.

    Attributes
    ----------
    candidate
        A named effect, or a shape without a name.
    fit
        The drive with it; ``None`` for a shape.
    gain : ndarray, shape (R,)
        Gain of predictive log-likelihood.
    size
        How many parameters it adds.
    """

    candidate: Candidate | Shape
    fit: Fit | None
    gain: FloatArray
    size: int

    @property
    def name(self) -> Name:
        """What a finding is called by."""
        return self.candidate.name

    @property
    def total(self) -> float:
        """Gain over all recordings."""
        return float(self.gain.sum())


@dataclass(frozen=True, eq=False)
class Round:
    """One step of the forward selection.

    Attributes
    ----------
    base
        Fit of the model before it.
    scored
        Every candidate that was fitted, best first.
    null
        Null distribution.
    noise
        Of the rows.
    p, p_rest
        P-values of the best: of its gain, and of its gain without the recording that gains most.
    accepted
        Whether the best one is taken.
    """

    base: Fit
    scored: tuple[Scored, ...]
    null: Null
    noise: Noise
    p: float
    p_rest: float
    accepted: bool
    linear: Linear = field(repr=False)
    variability: tuple[Direction, ...] = field(repr=False, default=())

    @property
    def best(self) -> Scored:
        """Return the best candidate."""
        return self.scored[0]

    def ties(self) -> list[Scored]:
        """Return the other candidates whose scores over recordings do not differ from the best one's, at most three."""
        found = [s for s in self.scored[1:] if s.name != self.best.name and tied(self.best, s)]
        return found[:3]


def _p_values(null: Null, scored: Scored) -> tuple[float, float]:
    """Return the p-values of a candidate's gain, and of its gain without the recording that gains most.

    One recording may gain much by chance, or by a fault: the rest must gain, too.
    """
    rest = null.p_without_best(scored.name, float(trimmed(scored.gain)))
    return null.p_value(scored.name, scored.total), rest


def _ranked(scored: Sequence[Scored], leaders: Sequence[Scored]) -> list[Scored]:
    """Return candidates with the one that is named first: ranked by gain, tested by score.

    Of the significant ones that with the largest gain shows that something is there. Whatever predicts as well or better is asked
    who predicts best, be it significant by itself or not, and of those that tie with that one the least is said: the name with
    the fewest parameters.
    """
    order = sorted(scored, key=lambda s: -s.total)
    names = {s.name for s in leaders}
    leader = next(s for s in order if s.name in names)
    top = next(s for s in order if s is leader or tied(leader, s))
    alike = [s for s in order if s is top or tied(top, s)]
    first = min(alike, key=lambda s: (isinstance(s.candidate, Shape), s.size, -s.total))
    return [first, *(s for s in order if s is not first)]


def tied(best: Scored, other: Scored) -> bool:
    """Whether the paired scores of two candidates do not differ, and the other one predicts nearly as well.

    Two names for one force differ by round-off alone, the same in all recordings: that is no difference either.
    """
    if other.total < 0.5 * best.total:
        return False
    difference = best.gain - other.gain
    return float(difference.sum()) < NEGLIGIBLE * abs(best.total) or float(studentised(difference)) < TIE


@dataclass(frozen=True, eq=False)
class Selection:
    """All rounds, and the drive at the end.

    Attributes
    ----------
    rounds
        The last one accepted nothing, unless the most effects were reached.
    first
        Fit of the base model.
    model
        Fit with all accepted effects.
    accepted
        The candidates taken, in order, with their rounds.
    variability
        Run-to-run variability around the final model.
    """

    rounds: tuple[Round, ...]
    first: Fit
    model: Fit
    accepted: tuple[tuple[Candidate, Round], ...]
    variability: tuple[Direction, ...]


class Selector:
    """Selects effects for the recordings of one drive.

    Parameters
    ----------
    bench
        Recordings.
    topology
        Bodies, and what every fit moves.
    known
        Sizes of effects that the base model has already.
    alpha
        Level of the test.
    rng
        Source of the null draws.
    say
        Called with a few words at every step.
    """

    def __init__(
        self, bench: Bench, topology: Topology, known: Values, alpha: float, rng: np.random.Generator, say: Say
    ) -> None:
        self.bench, self.topology, self.alpha, self.rng, self.say = bench, topology, alpha, rng, say
        self.settings = bench.settings
        self.known = dict(known)
        self.base_names = [*topology.free, *self.known]
        self.candidates = catalogue(topology, self.known)

    def run(self) -> Selection:
        """Return the selected effects."""
        self.say("fitting the base model")
        base = self._first()
        found = directions(self.bench, base.values)
        noise = estimate(self.bench, base.residual, found)
        base = fit(self.bench, noise, base.values, base.names)
        first = base
        rounds: list[Round] = []
        taken: list[tuple[Candidate, Round]] = []
        while len(rounds) < self.settings.rounds:
            self.say(f"round {len(rounds) + 1}")
            step = self._round(base, noise, found, rounds[-1] if rounds else None)
            rounds.append(step)
            noise, found = step.noise, list(step.variability)
            if len(rounds) == 1:
                first = step.base
            base = step.base
            if not step.accepted or step.best.fit is None or not isinstance(step.best.candidate, Candidate):
                break
            base = step.best.fit
            taken.append((step.best.candidate, step))
        return Selection(tuple(rounds), first, base, tuple(taken), tuple(found))

    def _first(self) -> Fit:
        """Fit the base model from every start there is; the best optimum is the one that is compared with."""
        noise = first_noise(self.bench)
        starts = _base_starts(self.bench, self.topology)
        tries = self.bench.pool.map(
            lambda values: fit(self.bench, noise, {**values, **self.known}, self.base_names, iterations=_TRY), starts
        )
        best = sorted(tries, key=lambda f: f.cost)[:2]
        return min((fit(self.bench, noise, f.values, f.names) for f in best), key=lambda f: f.cost)

    def _round(self, base: Fit, noise: Noise, found: Sequence[Direction], last: Round | None) -> Round:
        # around a model that is near, the simulation's own sensitivities tell more than the equation error
        screens = self._screens(base) if last is None else []
        before = _carried(last, base)
        level = max(dry_level(base.values, c) for c in range(self.bench.carts))
        shaped = shapes(self.bench, base.values, max(0.05, 0.1 * level))
        linear = linearise(self.bench, noise, base, self.candidates, shaped)
        fits = self._fits(base, noise, linear, screens, before)
        for turn in range(2):
            better = self._better_base(base, noise, fits)
            if better is not base:
                base, linear = better, linear.around(better, noise)
            scored = self._scored(base, linear, fits)
            generous = self._generous(base, linear, scored)
            if turn == 1:
                break
            # noise levels of a model that lacks what is to be found would hide it
            model = min([base, *(s.fit for s in scored if s.fit is not None)], key=lambda f: f.cost)
            found = directions(self.bench, model.values)
            noise = estimate(self.bench, generous, found)
            base = fit(self.bench, noise, base.values, base.names)
            linear = linear.around(base, noise)
            fits = self._refits(base, noise, fits)
        null = null_of(linear, self.bench, generous, found, self.rng)
        tested = [(max(_p_values(null, s)), s) for s in scored]
        significant = [s for p, s in tested if p <= self.alpha and s.total > 0.0]
        ranked = _ranked(self._pruned(base, noise, scored, significant), significant or scored)
        p, p_rest = min((_p_values(null, s) for s in significant or ranked[:1]), key=max)
        return Round(base, tuple(ranked), null, noise, p, p_rest, bool(significant), linear, tuple(found))

    def _pruned(self, base: Fit, noise: Noise, scored: Sequence[Scored], significant: Sequence[Scored]) -> list[Scored]:
        """Return candidates where the best one has no more sizes than it needs: one that predicts as well alone is enough."""
        best = max(significant, key=lambda s: s.total, default=None)
        if best is None or best.fit is None or not isinstance(best.candidate, Candidate):
            return list(scored)
        whole = best.candidate
        if len(whole.sizes) < 2 or any(k.rsplit(".", 1)[-1] == "a_sin" for k, _ in whole.sizes):
            return list(scored)
        for size in whole.sizes:
            part = replace(whole, sizes=(size,))
            rest = [k for k in whole.keys if k not in part.keys]
            start = {k: v for k, v in best.fit.values.items() if k not in rest}
            smaller = fit(self.bench, noise, start, (*base.names, *part.keys))
            own = Scored(part, smaller, gains(base.normal, smaller.normal, self.settings.damping), len(part.keys))
            if tied(best, own):
                return [own if s is best else s for s in scored]
        return list(scored)

    def _screens(self, base: Fit) -> list[list[Proposal]]:
        present = {k: v for k, v in base.values.items() if k not in self.topology.free}
        candidates = [c for c in self.candidates if not any(k in base.values for k, _ in c.sizes)]
        return [
            Screen(self.bench.recordings, self.settings, self.bench.pool, present, resting=resting).propose(candidates)
            for resting in (False, True)
        ]

    def _fits(
        self,
        base: Fit,
        noise: Noise,
        linear: Linear,
        screens: Sequence[Sequence[Proposal]],
        known: Sequence[tuple[Candidate, dict[str, float]]],
    ) -> dict[Name, tuple[Candidate, Fit]]:
        """Fit the proposed candidates by output error, each from all its starts."""
        jobs = self._jobs(base, linear, screens)
        for candidate, start in known:
            jobs.setdefault(candidate.name, []).append((candidate, start))
        columns = {e.candidate: e.columns for e in linear.entries if isinstance(e.candidate, Candidate)}
        inner = linear.columns[:, list(linear.base)]
        rate = base.scale[base.interior]

        def tried(job: tuple[Candidate, dict[str, float]]) -> tuple[Candidate, Fit]:
            candidate, start = job
            names = (*base.names, *candidate.keys)
            near = all(start[n] == base.values[n] for n in base.names)
            known_ = None
            if near and candidate in columns and not candidate.shapes and base.interior.all():
                known_ = np.column_stack([inner / rate, linear.columns[:, list(columns[candidate])]])
            return candidate, fit(self.bench, noise, start, names, iterations=_TRY, jacobian=known_)

        flat = [(name, job) for name, starts in jobs.items() for job in starts]
        tries = list(self.bench.pool.map(lambda item: tried(item[1]), flat))
        best: dict[Name, tuple[Candidate, Fit]] = {}
        for (name, _), found in zip(flat, tries, strict=True):
            if name not in best or found[1].cost < best[name][1].cost:
                best[name] = found
        order = sorted(best, key=lambda n: best[n][1].cost)
        leading = order[: self.settings.finished]
        ended = self.bench.pool.map(lambda n: fit(self.bench, noise, best[n][1].values, best[n][1].names), leading)
        return best | {n: (best[n][0], f) for n, f in zip(leading, ended, strict=True)}

    def _refits(
        self, base: Fit, noise: Noise, fits: Mapping[Name, tuple[Candidate, Fit]]
    ) -> dict[Name, tuple[Candidate, Fit]]:
        """Fit candidates again after the noise has changed, from where they ended."""
        order = sorted(fits, key=lambda n: fits[n][1].cost)

        def one(i: int) -> tuple[Candidate, Fit]:
            candidate, old = fits[order[i]]
            most = None if i < self.settings.finished else _TRY
            return candidate, fit(self.bench, noise, old.values, (*base.names, *candidate.keys), iterations=most)

        return dict(zip(order, self.bench.pool.map(one, range(len(order))), strict=True))

    def _jobs(
        self, base: Fit, linear: Linear, screens: Sequence[Sequence[Proposal]]
    ) -> dict[Name, list[tuple[Candidate, dict[str, float]]]]:
        jobs: dict[Name, list[tuple[Candidate, dict[str, float]]]] = {}
        near = _linear_starts(base, linear, self.settings.damping)
        share = self.settings.proposals // 2
        for candidate, start in _leading(near, share):
            jobs.setdefault(candidate.name, []).append((candidate, start))
        for proposals in screens:
            far = [(p.candidate, {**base.values, **p.start}) for p in proposals if _sound(p.start) and p.gain > 0.0]
            for candidate, start in _leading(far, share):
                jobs.setdefault(candidate.name, []).append((candidate, start))
        # whoever is asked is asked together with its look-alikes
        for candidate, start in near:
            if candidate.name not in jobs and any(candidate.id in look_alikes(i) for i, _ in list(jobs)[:3]):
                jobs[candidate.name] = [(candidate, start)]
        # what a cart at rest hides has no sensitivity: it is always asked for, with the friction that hides it taken over
        hidden = {c.name: c for c in self.candidates if c.takes and not any(k in base.values for k in c.keys)}
        for candidate in hidden.values():
            usual = replace(candidate, shapes=tuple((k, null_value(k)) for k, _ in candidate.shapes))
            jobs.setdefault(candidate.name, []).append((usual, _taking_over(usual, base.values)))
        return jobs

    def _better_base(self, base: Fit, noise: Noise, fits: Mapping[Name, tuple[Candidate, Fit]]) -> Fit:
        """Refit the base model from the candidates' optima: a better optimum of it must not pass for a gain."""
        leading = sorted(fits.values(), key=lambda item: item[1].cost)[:4]

        def one(item: tuple[Candidate, Fit]) -> Fit:
            candidate, best = item
            values = {k: v for k, v in best.values.items() if k not in candidate.keys}
            for key, taken in candidate.takes:
                values[taken] = values.get(taken, 0.0) + best.values.get(key, 0.0)
            return fit(self.bench, noise, values, base.names)

        return min([base, *self.bench.pool.map(one, leading)], key=lambda f: f.cost)

    def _scored(self, base: Fit, linear: Linear, fits: Mapping[Name, tuple[Candidate, Fit]]) -> list[Scored]:
        damping = self.settings.damping
        found: list[Scored] = [
            Scored(c, f, gains(base.normal, f.normal, damping), len(c.keys)) for c, f in fits.values()
        ]
        for entry in linear.entries:
            if isinstance(entry.candidate, Shape):
                gain = gains(linear.normal(), linear.normal(entry.columns), damping)
                found.append(Scored(entry.candidate, None, gain, len(entry.columns)))
        return sorted(found, key=lambda s: -s.total)

    def _generous(self, base: Fit, linear: Linear, scored: Sequence[Scored]) -> FloatArray:
        """Return the residual of a model with the best candidate and, linearly, whatever else gains besides it.

        What gains is judged without run-to-run variability: its size is estimated from this residual, and what it had swallowed
        would stay swallowed.
        """
        fits = [s.fit for s in scored if s.fit is not None]
        best = min([base, *fits], key=lambda f: f.cost)
        here = linear.against(best.residual)
        columns: list[int] = []
        rest: list[Entry] = list(here.entries)
        before = here.normal(plain=True)
        for _ in range(self.settings.generous):
            after = [(here.normal([*columns, *e.columns], plain=True), e) for e in rest]
            gain, i = max((float(gains(before, n, self.settings.damping).sum()), i) for i, (n, _) in enumerate(after))
            if gain <= 0.0:
                break
            before, entry = after[i]
            columns += [c for c in entry.columns if c not in columns]
            before = here.normal(columns, plain=True)
            rest.remove(entry)
        step = before.solve(self.settings.damping)
        return np.asarray(best.residual + linear.columns[:, [*linear.base, *columns]] @ step)


def _base_starts(bench: Bench, topology: Topology) -> list[dict[str, float]]:
    """Return starts of the base model: both equation errors, a heavier cart 2, other stiffnesses, and no friction."""
    starts = [Screen(bench.recordings, bench.settings, bench.pool).values]
    found = start_values(bench.recordings, topology)
    starts.append({**topology.start, **found})
    good = [_positive(s, topology) for s in starts if _sound({k: v for k, v in s.items() if k[0] == "m"})]
    good = good or [_positive(starts[1], topology)]
    first = good[0]
    if "k" in first:
        good += [{**first, "k": f * first["k"]} for f in (0.5, 2.0)]
    if "m2" in first and "m2" in topology.free:
        good.append({**first, "m2": 1.5 * first["m2"], "k": 1.3 * first["k"]})
    good.append({**first, **{k: 0.3 * v for k, v in first.items() if k[0] == "d"}})
    return [{**s, **topology.fixed} for s in good]


def _positive(values: Values, topology: Topology) -> dict[str, float]:
    mass = max([v for n, v in values.items() if n[0] == "m" and 0.0 < v < 1e6] or [1e-3])
    small = {"m": 0.3 * mass, "k": mass * 350.0, "b": mass, "d": 0.0}
    names = [n for n in topology.free if n not in topology.fixed]
    return {n: v if (v := values.get(n, 0.0)) > 0.0 else small.get(n[0], parameter(n).null) for n in names}


def _linear_starts(base: Fit, linear: Linear, damping: float) -> list[tuple[Candidate, dict[str, float]]]:
    """Return every name's best entry around the simulation with its sizes, best first."""
    without = linear.normal()
    found: dict[Name, tuple[float, Candidate, dict[str, float]]] = {}
    for entry in linear.entries:
        if not isinstance(entry.candidate, Candidate):
            continue
        normal = linear.normal(entry.columns)
        gain = float(gains(without, normal, damping).sum())
        if entry.candidate.name in found and gain <= found[entry.candidate.name][0]:
            continue
        sizes = normal.solve(damping)[len(linear.base) :]
        own = {}
        for (key, start), size in zip(entry.candidate.sizes, sizes, strict=True):
            q = parameter(key)
            least = 0.1 * start
            # a size of the wrong sign cannot be fitted from null, where there is no slope to see
            own[key] = float(np.clip(size, q.lower, q.upper)) if abs(size) > least and size > q.lower else least
        start_of = {**base.values, **entry.candidate.start, **own}
        found[entry.candidate.name] = (gain, entry.candidate, start_of)
    return [(c, s) for _, c, s in sorted(found.values(), key=lambda item: -item[0])]


def _carried(last: Round | None, base: Fit) -> list[tuple[Candidate, dict[str, float]]]:
    """Return the candidates that gained in the round before, from where they ended, beside what was accepted since."""
    found = []
    for s in last.scored[1:] if last is not None else ():
        if s.fit is None or not isinstance(s.candidate, Candidate) or s.total <= 0.0:
            continue
        if not any(k in base.values for k in s.candidate.keys):
            own = {k: s.fit.values[k] for k in s.candidate.keys}
            # the second with the base parameters that it had changed as well
            found += [(s.candidate, {**base.values, **own}), (s.candidate, {**base.values, **s.fit.values})]
    return found


def _leading(
    starts: Sequence[tuple[Candidate, dict[str, float]]], names: int
) -> list[tuple[Candidate, dict[str, float]]]:
    """Return the first start of each of the first few names."""
    found: dict[Name, tuple[Candidate, dict[str, float]]] = {}
    for candidate, start in starts:
        if candidate.name not in found and len(found) < names:
            found[candidate.name] = (candidate, start)
    return list(found.values())


def _taking_over(candidate: Candidate, values: Values) -> dict[str, float]:
    """Return a start in which a candidate has taken over the base parameter that would hide it."""
    start = {**values, **candidate.start}
    for key, taken in candidate.takes:
        level = values.get(taken, 0.0)
        start |= {key: max(level, candidate.start[key]), taken: 0.1 * level}
    return start


def _sound(values: Values) -> bool:
    return all(np.isfinite(v) for v in values.values())

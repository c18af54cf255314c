"""Forward selection of effects, then backward: which candidates improve the prediction of other experiments beyond the null."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from identification.mismatch.candidates.catalogue import Candidate, catalogue, further, look_alikes
from identification.mismatch.fitting.bench import Bench, SingleArray, Values
from identification.mismatch.fitting.fit import Fit, fit, gain_of
from identification.mismatch.fitting.score import shared
from identification.mismatch.noise.estimate import Noise, damped, of_most
from identification.mismatch.noise.nuisance import Direction
from identification.mismatch.noise.scatter import dispersed
from identification.mismatch.selection.account import Account, sensitivities
from identification.mismatch.selection.detection import detection_limits
from identification.mismatch.selection.evaluate import Name, Table, evaluate, random_gains
from identification.mismatch.selection.linear import Linear
from identification.mismatch.selection.naming import Naming
from identification.mismatch.selection.null import Null, first_draws, judged, null_of
from identification.mismatch.selection.one_size import differs
from identification.mismatch.selection.optima import (
    carried_over,
    contained,
    far,
    fit_base,
    fit_candidates,
    imitating,
    nearest,
    pruned,
    refined,
    refit_base,
    without,
)
from identification.mismatch.selection.ranking import (
    MOST,
    Round,
    Scored,
    dispensable,
    joined,
    nameless,
    ranked,
    scores,
)
from identification.mismatch.selection.start import Start, candidate_starts, far_starts, misread_starts
from identification.topology import Topology

Say = Callable[[str], None]
# share of the largest unknown forces that there may be, from which on they may hide anything
_HIDING = 0.5


def _absent(candidates: Sequence[Candidate], base: Fit) -> set[str]:
    """Return the base parameters that candidates can take over and that this model does not have."""
    return {taken for c in candidates for _, taken in c.takes if taken not in base.names}


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
    level
        Of the test of a round.
    differing
        Candidates that were taken, and left out again because their size differs between experiments.
    ended
        Whether nothing was left to name when the search ended; otherwise it had come to the most rounds that it may have.
    """

    rounds: tuple[Round, ...]
    first: Fit
    model: Fit
    accepted: tuple[tuple[Scored, Round], ...]
    variability: tuple[Direction, ...]
    level: float
    differing: tuple[tuple[Scored, Round], ...] = ()
    ended: bool = True

    @property
    def doubtful(self) -> Scored | None:
        """Return what is likely in the last round, though not significant."""
        last, named = self.rounds[-1], {s.name for s, _ in self.accepted}
        likely = [s for s in last.scored if s.p <= self.model.bench.settings.likely and s.name not in named]
        return None if last.accepted else min(likely, key=lambda s: s.p, default=None)

    @property
    def hiding(self) -> str | None:
        """Return the cart whose unknown forces are so large that they may hide anything, if there is one."""
        forces = of_most(self.rounds[-1].noise).max(axis=0)
        return f"cart {np.argmax(forces) + 1}" if forces.max() > _HIDING else None


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
        Share of data sets that may get a name of nothing: half for the first round, half for those that follow it.
    seed
        Of the null draws.
    say
        Called with a few words at every step.
    """

    def __init__(self, bench: Bench, topology: Topology, known: Values, alpha: float, seed: int, say: Say) -> None:
        self.bench, self.topology, self.level, self.seed, self.say = bench, topology, 0.5 * alpha, seed, say
        self.settings = bench.settings
        self.naming, self.known = Naming(bench, self.level), dict(known)
        reach = max(float(np.max(np.abs(run.u))) for run in bench.runs)
        filtered = all(run.cutoff is None for run in bench.runs)
        self.candidates = catalogue(topology, self.known, reach or None, bench.scale, filtered=filtered)

    def run(self) -> Selection:
        """Return the selected effects."""
        self.say("fitting the base model")
        base = fit_base(self.bench, self.topology, self.known)
        phases: tuple[Direction, ...] = ()
        rounds: list[Round] = []
        taken: list[tuple[Scored, Round]] = []
        proposed = self._proposed(base)
        near = self._near(base, proposed)
        # where a free function won, and names are tried in its place
        doubted: int | None = None
        ended = False
        while len(rounds) < self.settings.rounds:
            self.say(f"round {len(rounds) + 1} of at most {self.settings.rounds}")
            step = self._round(base, near, phases, taken, () if rounds else proposed)
            rounds.append(step)
            base = step.base
            name = self.naming.name(step, rounds[0].base, sum(s.total for s, _ in taken)) if step.accepted else None
            if name is None or (nameless(step.best) and doubted is not None):
                ended = True
                break
            if nameless(step.best):
                doubted = len(taken)
            own = step.with_first(name)
            taken = joined(taken, name, own)
            phases = (*phases, *name.variability)
            base = name.fit or base
            near = base
        if doubted is not None and not self.naming.stand(taken[doubted:], rounds[doubted]):
            rounds, taken, base, ended = rounds[: doubted + 1], taken[:doubted], rounds[doubted].base, True
        taken, base = self._backward(taken, base, rounds[-1])
        kept, base = self._of_one_size(taken, base, rounds[-1])
        differing = tuple(item for item in taken if item not in kept)
        last = rounds[-1].variability
        return Selection(tuple(rounds), rounds[0].base, base, tuple(kept), last, self.level, differing, ended)

    def _proposed(self, base: Fit) -> list[Start]:
        """Return candidates with parameters as the equation error sees them, where the simulation is far from the data."""
        if not far(base):
            return []
        absent = _absent(self.candidates, base)
        return [
            *self._seen_far(base, self.candidates),
            # of readings that are wrong an equation of motion says nothing
            *misread_starts(base.values, self.candidates, self.topology),
            *((c, c.start) for c in self.candidates if absent.issuperset(c.keys)),
        ]

    def _seen_far(self, base: Fit, candidates: Sequence[Candidate]) -> list[Start]:
        """Return the candidates that the equation error puts first, with the parameters that it sees."""
        # dry friction is in the equation already, whether the model has it or not
        known = {k: v for k, v in base.values.items() if "." in k}
        return far_starts(self.bench, base, known, candidates)

    def _near(self, base: Fit, proposed: Sequence[Start]) -> Fit:
        """Return the model with the candidate that brings a simulation near that is far from the data: it tells what is noise."""
        fits = fit_candidates(base, base.metric, [(c, {**base.values, **own}) for c, own in proposed])
        best = min((f for _, f in fits.values()), key=lambda f: f.cost, default=base)
        return best if best.cost < (1.0 - self.settings.large) * base.cost else base

    def _round(
        self,
        base: Fit,
        near: Fit,
        phases: tuple[Direction, ...],
        taken: Sequence[tuple[Scored, Round]],
        proposed: Sequence[Start],
    ) -> Round:
        bench, seed = self.bench, [self.seed, len(taken)]
        named = {s.name: s.candidate for s, _ in taken}
        candidates = [c for c in self.candidates if self._placed(c, named) and further(c, named.get(c.name))]
        started, model = base, near
        fits: dict[Name, tuple[Candidate, Fit]] = {}
        noise: Noise | None = None
        linear: Linear | None = None
        for turn in range(2):
            account = Account.of(model, noise, phases, candidates)
            if noise is None:
                account = account.freed(phases, candidates, partial(self._seen_far, candidates=candidates))
            elif account.noise.cost > noise.cost:
                # the account of the residual that there was is more probable
                break
            found = account.found
            told, left = account.unexplained()
            base = fit(bench, told, base.values, base.names, near=base)
            noise, first = first_draws(told, found, left, seed)
            if linear is None:
                linear = account.linear if account.model is started else sensitivities(bench, noise, base, candidates)
            linear = linear.around(base, noise)
            noise, first = dispersed(noise, linear.shared, first)
            base = fit(bench, noise, base.values, base.names, near=base)
            linear = linear.around(base, noise)
            table = evaluate(linear, linear.residual[:, None])
            jobs = [(c, f.values) for c, f in fits.values()] or [
                *self._jobs(base, linear, table, first, candidates),
                *((c, {**base.values, **own}) for c, own in proposed),
                *(job for m in (near, account.model) for job in contained(base, m, candidates)),
            ]
            # what gains so much is told again, with noise around it
            enough = 2.0 * self.settings.again if turn == 0 else np.inf
            fits = refined(base, noise, fit_candidates(base, noise, jobs, enough=enough))
            model = min((f for _, f in fits.values()), key=lambda f: f.cost, default=base)
            if model.cost > base.cost - enough:
                break
            # hundreds of columns that are not needed beside those of the next turn
            del account
        assert linear is not None
        return self._judged(linear, first, fits, found, candidates, seed, named)

    def _placed(self, candidate: Candidate, named: Collection[Name]) -> bool:
        """Whether recordings tell the place that a candidate repeats with: a speed without sign adds up to none."""
        cart = "2" if candidate.where.endswith("2") else "1"
        known = all(getattr(r, f"x{cart}") is not None for r in self.bench.recordings)
        waves = any(k.endswith(".P") for k in candidate.keys)
        return known or not waves or ("rectified_sensor", f"encoder_{cart}") not in named

    def _judged(
        self,
        linear: Linear,
        first: SingleArray,
        fits: dict[Name, tuple[Candidate, Fit]],
        found: Sequence[Direction],
        candidates: Sequence[Candidate],
        seed: Sequence[int],
        said: Collection[Name],
    ) -> Round:
        """Hold the candidates against their null draws, and the base model against their optima."""
        noise, before = linear.noise, linear.model
        leading = sorted(fits.values(), key=lambda item: item[1].cost)[: self.settings.finished]
        base = refit_base(before, noise, leading)
        fits = carried_over(before, base, noise, fits)
        leading = [fits[c.name] for c, _ in leading if c.name in fits]
        linear = linear.around(base, noise)
        table = evaluate(linear, linear.residual[:, None])
        null = null_of(linear, noise, found, first, table, seed)
        scored = scores(base, linear, table, fits, null)
        # whatever may be named is fitted before it is, and so is what looks like the leader
        if jobs := self._beside_the_leader(linear, table, scored, leading[:1], candidates):
            fits = nearest(fits, fit_candidates(base, noise, jobs))
            scored = scores(base, linear, table, fits, null)
        asked = {candidate.name for candidate, _ in leading}
        while True:
            significant = self.naming.significant(scored)
            order = ranked(scored, significant, said)
            named = [fits[s.name] for s in (order[0], *significant[:2]) if s.name in fits and s.name not in asked]
            asked |= {candidate.name for candidate, _ in named}
            better = refit_base(base, noise, named)
            if better is base:
                order = ranked(pruned(base, noise, scored, significant), significant, said)
                limits = detection_limits(linear, null, self.level)
                return Round(base, tuple(order), null, noise, bool(significant), tuple(found), limits)
            fits = carried_over(base, better, noise, fits)
            base, linear = better, linear.around(better, noise)
            table = evaluate(linear, linear.residual[:, None])
            scored = scores(base, linear, table, fits, null)

    def _beside_the_leader(
        self,
        linear: Linear,
        table: Table,
        scored: Sequence[Scored],
        leading: Sequence[tuple[Candidate, Fit]],
        candidates: Sequence[Candidate],
    ) -> list[Start]:
        """Return starts of candidates that may be named and were not fitted, and of those that look like the leader."""
        base = linear.model
        likely = {s.name: s.total for s in scored if s.rarity <= self.settings.likely and not nameless(s)}
        least = 0.5 * max(likely.values(), default=np.inf)
        alike, beside, found = set[str](), dict[str, float](), list[Start]()
        for leader, there in leading:
            alike = look_alikes(leader.id)
            beside = {k: v for k, v in without(leader, there.values, base.names).items() if k in base.names}
            if leader.name in likely:
                found = imitating(base, linear.noise, candidates, leader, there)
        missing = {s.name for s in scored if s.fit is None and (s.total >= least > 0.0 or s.name[0] in alike)}
        these = [c for c in candidates if c.name in missing]
        more = candidate_starts(base, linear, table, these, sorted(missing), len(missing)) if missing else []
        more = [job for job in more if job[0].name in missing]
        return [*found, *more, *((c, {**v, **beside}) for c, v in more if c.id in alike)]

    def _jobs(
        self, base: Fit, linear: Linear, table: Table, first: SingleArray, candidates: Sequence[Candidate]
    ) -> list[tuple[Candidate, dict[str, float]]]:
        """Return what to fit: in turn names whose linear change is the least like chance, and those whose change gains most."""
        prior = Null.over(judged(linear, first))
        asked = {c.name for c in candidates}
        gain = {n: float(total[0]) for n, total in table.total.items() if n in asked}
        rarest = sorted(gain, key=lambda n: -prior.score(n, gain[n]))
        largest = sorted(gain, key=lambda n: -gain[n])
        order = list(dict.fromkeys(n for pair in zip(rarest, largest, strict=True) for n in pair))
        return candidate_starts(base, linear, table, candidates, order, self.settings.proposals)

    def _backward(
        self, taken: list[tuple[Scored, Round]], model: Fit, last: Round
    ) -> tuple[list[tuple[Scored, Round]], Fit]:
        """Leave out what no longer predicts beside all others, the least first."""
        while len(taken) > 1:
            model = fit(self.bench, last.noise, model.values, model.names)
            asked = dispensable([scored for scored, _ in taken])
            ones = [(s, step) for s, step in taken if s in asked]
            found = self.bench.pool.map(partial(self._without, model=model, last=last), *zip(*ones, strict=True))
            left_out = [(rarity, less, s) for (rarity, less), (s, _) in zip(found, ones, strict=True)]
            # what stands for a free function needs not be rarer than it was then, and what keeps the simulation near stays:
            # draws around a model that is far away tell nothing
            weak = [
                (rarity, less, s)
                for rarity, less, s in left_out
                if rarity > max(self.level, s.rarity) and self.naming.share_beside(s, model, less) < MOST
            ]
            if not weak:
                break
            _, less, weakest = max(weak, key=lambda item: item[0])
            model = less
            taken = [(s, step) for s, step in taken if s is not weakest]
        return taken, model

    def _of_one_size(
        self, taken: Sequence[tuple[Scored, Round]], model: Fit, last: Round
    ) -> tuple[list[tuple[Scored, Round]], Fit]:
        """Leave out what has another size in every experiment, beside all others: its law is another."""
        asked = dispensable([scored for scored, _ in taken])
        odd = [
            (s, step)
            for s, step in taken
            if s in asked and isinstance(s.candidate, Candidate) and differs(model, s.candidate, self.level)
        ]
        for scored, step in odd:
            _, model = self._without(scored, step, model, last)
        return [item for item in taken if item not in odd], model

    def _without(self, scored: Scored, step: Round, model: Fit, last: Round) -> tuple[float, Fit]:
        """Return the rarity of an accepted candidate beside all others, and the model without it.

        What it gains by chance is told by the draws of the round that took it, which lack it.
        """
        if not isinstance(scored.candidate, Candidate):
            own = {d.group for d in scored.variability}
            noise = damped(last.noise, [d for d in last.variability if d.group not in own])
            columns = noise.white(np.column_stack([d.change for d in scored.variability]))
            ((gain, _),) = random_gains(self.bench, columns, noise.white(model.residual)[:, None])
            return step.null.rarity(scored.name, float(shared(gain[:, 0]))), model
        names = [n for n in model.names if n not in scored.candidate.keys]
        less = fit(self.bench, last.noise, without(scored.candidate, model.values, names), names)
        return step.null.rarity(scored.name, float(shared(gain_of(less, model)))), less

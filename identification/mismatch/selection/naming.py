"""Which of the candidates that gain more than chance gets a name: what a simulation needs, and earlier names leave."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

from identification.mismatch.candidates.catalogue import Candidate
from identification.mismatch.fitting.bench import Bench
from identification.mismatch.fitting.fit import Fit
from identification.mismatch.noise.marginal import marginal
from identification.mismatch.selection.output_error import held_first, needed, restarts, share_of_error
from identification.mismatch.selection.ranking import MOST, Round, Scored, nameless

# significant names that are asked after the first one
_MORE = 3


@dataclass(frozen=True)
class Naming:
    """The questions that stand beside the score.

    Attributes
    ----------
    bench
        Recordings.
    level
        Of the test of a round.
    """

    bench: Bench
    level: float

    def name(self, step: Round, before: Fit, gained: float) -> Scored | None:
        """Return what a round names: the first that a simulation needs, of the significant names where a free function won.

        Another that gains less than half of the most may gain from what that is, and what is next to nothing beside earlier
        names from what these do not describe, for no law of the catalogue is exact; unless it brings the simulation near.

        Parameters
        ----------
        before
            Fit without any name.
        gained
            By earlier names.
        """
        settings = self.bench.settings
        significant = [s for s in self.significant(step.scored) if not nameless(s)]
        half = MOST * max((s.total for s in significant), default=0.0)
        order = significant if nameless(step.best) else [step.best, *(s for s in significant if s is not step.best)]

        def stands(s: Scored) -> bool:
            share = self.share(s, step, step.base)
            if share >= settings.large:
                return True
            own = s is step.best or s.total >= half
            first = s is step.best and gained <= 0.0
            if not own or not needed(s, share, first=first, settings=settings):
                return False
            return s.total >= settings.inexact * gained or self.beyond(s, share, step, before)

        return next((s for s in order[: _MORE + 1] if stands(s)), None)

    def significant(self, scored: Sequence[Scored]) -> list[Scored]:
        """Return the candidates that gain more than data of this rig in which nothing is left out."""
        return [s for s in scored if s.p <= self.level]

    def share(self, scored: Scored, step: Round, base: Fit) -> float:
        """Return the share of the squared output error that a name takes off, beside what was named before, at its best.

        Parameters
        ----------
        step
            Whose run-to-run variability the error is beside.
        base
            The drive without the name.
        """
        best = scored.fit or base
        metric = marginal(self.bench, step.noise, step.variability, best.residual, base.residual)
        own = [scored.candidate] if isinstance(scored.candidate, Candidate) else []
        starts = [best.values, *restarts(self.bench, best, own)]
        fits = self.bench.pool.map(partial(held_first, self.bench, metric, names=best.names), starts)
        return share_of_error(scored, min(fits, key=lambda f: f.cost))

    def share_beside(self, scored: Scored, step: Round, whole: Fit, less: Fit) -> float:
        """Return the share that a name takes off beside all other names, from the drive with all of them and that without it."""
        beside = replace(scored, fit=whole) if isinstance(scored.candidate, Candidate) else scored
        return self.share(beside, step, less)

    def beyond(self, scored: Scored, share: float, step: Round, before: Fit) -> bool:
        """Whether a name takes more off the squared output error than the laws named before do not describe of theirs."""
        base, best = step.base, scored.fit or step.base
        metric = marginal(self.bench, step.noise, step.variability, best.residual, base.residual)
        with_them, without_them = (held_first(self.bench, metric, m.values, m.names).cost for m in (base, before))
        return share * with_them >= self.bench.settings.inexact * (without_them - with_them)

    def stand(self, names: Sequence[tuple[Scored, Round]], step: Round) -> bool:
        """Whether names stand for the free function that won.

        Together they gain most of what it gains, or one takes most of the error off the simulation.
        """
        return sum(s.total for s, _ in names) >= MOST * step.best.total or any(
            self.share(s, own, own.base) >= MOST for s, own in names
        )

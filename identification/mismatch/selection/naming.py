"""Which of the candidates that gain more than chance gets a name: what a simulation needs, and earlier names leave."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

from identification.mismatch.candidates.catalogue import Candidate
from identification.mismatch.fitting.bench import Bench
from identification.mismatch.fitting.fit import Fit, Metric
from identification.mismatch.fitting.levels import Levels
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
            first = s is step.best and gained <= 0.0
            share = self.share_of_first(s, step, step.base) if first else self.share(s, step.base)
            if share >= settings.large:
                return True
            own = s is step.best or s.total >= half
            if not own or not needed(s, share, first=first, settings=settings):
                return False
            return s.total >= settings.inexact * gained or self.beyond(s, share, step.base, before)

        return next((s for s in order[: _MORE + 1] if stands(s)), None)

    def significant(self, scored: Sequence[Scored]) -> list[Scored]:
        """Return the candidates that gain more than data of this rig in which nothing is left out."""
        return [s for s in scored if s.p <= self.level]

    def share(self, scored: Scored, base: Fit, metric: Metric | None = None) -> float:
        """Return the share of the squared output error that a name takes off, beside what was named before, at its best.

        Parameters
        ----------
        metric
            That tells the error; default: levels of recordings and carts.
        """
        best = scored.fit or base
        metric = Levels.of(self.bench, best.residual, base.residual) if metric is None else metric
        own = [scored.candidate] if isinstance(scored.candidate, Candidate) else []
        starts = [best.values, *restarts(self.bench, best, own)]
        fits = self.bench.pool.map(partial(held_first, self.bench, metric, names=best.names), starts)
        return share_of_error(scored, min(fits, key=lambda f: f.cost))

    def share_of_first(self, scored: Scored, step: Round, base: Fit) -> float:
        """Return the share of the first name: of the output error beside run-to-run variability, which hides small effects.

        A phase of its own in every run is run-to-run variability itself, so it is asked as others are.
        """
        if not isinstance(scored.candidate, Candidate):
            return self.share(scored, base)
        residuals = (scored.fit or base).residual, base.residual
        return self.share(scored, base, marginal(self.bench, step.noise, step.variability, *residuals))

    def share_beside(self, scored: Scored, whole: Fit, less: Fit) -> float:
        """Return the share that a name takes off beside all other names, from the drive with all of them and that without it."""
        beside = replace(scored, fit=whole) if isinstance(scored.candidate, Candidate) else scored
        return self.share(beside, less)

    def beyond(self, scored: Scored, share: float, base: Fit, before: Fit) -> bool:
        """Whether a name takes more off the squared output error than the laws named before do not describe of theirs."""
        levels = Levels.of(self.bench, (scored.fit or base).residual, base.residual)
        with_them, without_them = (held_first(self.bench, levels, m.values, m.names).cost for m in (base, before))
        return share * with_them >= self.bench.settings.inexact * (without_them - with_them)

    def stand(self, names: Sequence[tuple[Scored, Round]], step: Round) -> bool:
        """Whether names stand for the free function that won.

        Together they gain most of what it gains, or one takes most of the error off the simulation.
        """
        return sum(s.total for s, _ in names) >= MOST * step.best.total or any(
            self.share(s, own.base) >= MOST for s, own in names
        )

"""What a candidate scores, which of them tie, and which one is named."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from flexdrive_gym.recording import FloatArray
from identification.mismatch.candidates.catalogue import Candidate
from identification.mismatch.candidates.free import Shape
from identification.mismatch.candidates.narrow_band import Line
from identification.mismatch.candidates.phases import Phase
from identification.mismatch.fitting.fit import Fit, gain_of
from identification.mismatch.fitting.score import shared, studentised
from identification.mismatch.noise.estimate import Noise
from identification.mismatch.noise.nuisance import Direction
from identification.mismatch.selection.detection import DetectionLimit
from identification.mismatch.selection.evaluate import Name, Table
from identification.mismatch.selection.linear import Linear
from identification.mismatch.selection.null import Null

# paired t under which two candidates predict alike
TIE = 2.0
# share of a gain that is no difference between two candidates
NEGLIGIBLE = 0.01
# effects that change a level of dry friction, which must be there first
REFINE_FRICTION = frozenset(
    {
        "breakaway",
        "coulomb_asymmetry",
        "friction_drift",
        "load_friction",
        "position_friction",
        "presliding",
        "saturating_friction",
        "stribeck",
    }
)
# share of a free function's gain from which on a name stands for it: most of it
MOST = 0.5


@dataclass(frozen=True, eq=False)
class Scored:
    """A candidate at its optimum, with its score in every unit.

    Attributes
    ----------
    candidate
        A named effect, one with a phase of its own in every run, or a shape without a name.
    fit
        The drive with it; ``None`` where only its linear change was looked at.
    gain : ndarray, shape (U,)
        Gain of predictive log-likelihood, within what the others let expect.
    size
        How many parameters it adds.
    rarity
        Share of null draws in which some gain of the catalogue is as rare.
    p
        P-value of its gain.
    variability
        What every recording has its own amplitudes of, where the candidate has a phase.
    """

    candidate: Candidate | Shape | Phase | Line
    fit: Fit | None
    gain: FloatArray
    size: int
    rarity: float = 1.0
    p: float = 1.0
    variability: tuple[Direction, ...] = ()

    @property
    def name(self) -> Name:
        """What a finding is called by."""
        return self.candidate.name

    @property
    def total(self) -> float:
        """Gain over all units but the one that gains most."""
        return float(shared(self.gain))


@dataclass(frozen=True, eq=False)
class Round:
    """One step of the forward selection.

    Attributes
    ----------
    base
        Fit of the model before it.
    scored
        Every candidate that was fitted, the one that is named first.
    null
        Null distribution of gains.
    noise
        Of the rows.
    accepted
        Whether the first one is taken.
    variability
        Run-to-run variability.
    detection_limits
        Below which size the recordings do not show what is in no model yet.
    """

    base: Fit
    scored: tuple[Scored, ...]
    null: Null
    noise: Noise
    accepted: bool
    variability: tuple[Direction, ...] = ()
    detection_limits: tuple[DetectionLimit, ...] = ()

    @property
    def best(self) -> Scored:
        """Return the first candidate."""
        return self.scored[0]

    def with_first(self, name: Scored) -> Round:
        """Return the round with another candidate first."""
        return replace(self, scored=(name, *(s for s in self.scored if s is not name)))

    def ties(self) -> list[Scored]:
        """Return the other candidates whose scores over units do not differ from the first one's, at most three."""
        return [s for s in self.scored[1:] if s.name != self.best.name and tied(self.best, s)][:3]


def tied(best: Scored, other: Scored) -> bool:
    """Whether the paired scores of two candidates do not differ, and the other one predicts nearly as well.

    Two names for one force differ by round-off alone, the same everywhere: that is no difference either.
    """
    if other.total < 0.5 * best.total:
        return False
    difference = best.gain - other.gain
    return float(difference.sum()) < NEGLIGIBLE * abs(best.total) or float(studentised(difference)) < TIE


def ranked(
    scored: Sequence[Scored], significant: Sequence[Scored], named: Collection[Name] = frozenset()
) -> list[Scored]:
    """Return candidates with the one that is named first: ranked by gain, tested by p-value.

    Of the significant ones that with the largest gain shows that something is there. Whatever predicts as well or better is asked
    who predicts best, be it significant by itself or not. Of those that tie with that one the least is said: a name before a
    function without one, one that is significant by itself before one that is not, another size of an effect that has a name
    already before another name, one with fewer parameters before one with more. A free function contains the names that follow
    its variable, so a name that gains most of what it gains stands for it, significant by itself or not; what that leaves is
    looked for in the next round. A refinement of dry friction is named beside the dry friction that it refines, not in its place
    (J. A. Nelder, J. R. Stat. Soc. A 140, 1977): where a model has none, that comes first, whatever it gains by itself.
    """
    order = sorted(scored, key=lambda s: -s.total)
    names = {s.name for s in significant} or {order[0].name}
    leader = next(s for s in order if s.name in names)
    top = next(s for s in order if s is leader or tied(leader, s))
    least = MOST * top.total if nameless(top) else np.inf
    alike = [s for s in order if s is top or tied(top, s) or (not nameless(s) and s.total >= least)]
    first = min(alike, key=lambda s: (nameless(s), s.name not in names, s.name not in named, s.size, -s.total))
    if first.name[0] in REFINE_FRICTION:
        fitted = {s.name for s in order if s.fit is not None}
        plain = (s for s in order if s.name == ("coulomb_friction", first.name[1]) and s.name in names | fitted)
        first = next(plain, first)
    return [first, *(s for s in order if s is not first)]


def joined(taken: Sequence[tuple[Scored, Round]], more: Scored, step: Round) -> list[tuple[Scored, Round]]:
    """Return names with their rounds and one more; another size of an effect that has a name becomes part of that."""
    for i, (scored, then) in enumerate(taken):
        if (
            scored.name == more.name
            and isinstance(scored.candidate, Candidate)
            and isinstance(more.candidate, Candidate)
        ):
            whole = replace(scored.candidate, sizes=(*scored.candidate.sizes, *more.candidate.sizes))
            both = replace(
                scored, candidate=whole, fit=more.fit, gain=scored.gain + more.gain, size=scored.size + more.size
            )
            return [*taken[:i], (both, then), *taken[i + 1 :]]
    return [*taken, (more, step)]


def dispensable(scored: Sequence[Scored]) -> list[Scored]:
    """Return the candidates that may be left out beside the others: not dry friction that another one refines (Nelder)."""
    refined = {s.name[1] for s in scored if s.name[0] in REFINE_FRICTION}
    return [s for s in scored if s.name[0] != "coulomb_friction" or s.name[1] not in refined]


def nameless(scored: Scored) -> bool:
    """Whether a candidate is a free function or a line, which have no name."""
    return isinstance(scored.candidate, Shape | Line)


def scores(
    base: Fit,
    linear: Linear,
    table: Table,
    fits: Mapping[Name, tuple[Candidate, Fit]],
    null: Null,
) -> list[Scored]:
    """Return every name with its gain: of its fit where there is one, else of its linear change.

    Null draws know linear changes alone. A fit that gains more has found more, for the base model was fitted from there, too.
    """

    def chances(name: Name, gain: FloatArray) -> tuple[float, float]:
        total = float(shared(gain))
        return null.rarity(name, total), null.p_value(name, total)

    found = []
    periods = Counter(e.candidate.name for e in linear.entries if e.random)
    for name in {**table.best, **fits}:
        scored: Scored | None = None
        if name in table.best:
            entry = table.best[name]
            variability: tuple[Direction, ...] = ()
            if isinstance(entry.candidate, Phase) and entry.variance is not None:
                group, spread = "@".join(name), float(np.sqrt(entry.variance))
                changes = (linear.changes[:, c - len(linear.base)] for c in entry.columns)
                variability = tuple(Direction(group, spread, change.astype(np.float64)) for change in changes)
            size, chance = max(len(entry.columns), 2), chances(name, entry.gain)
            scored = Scored(entry.candidate, None, entry.gain, size, *chance, variability)
        if name in fits:
            candidate, best = fits[name]
            gain = np.zeros(len(linear.products))
            # a fit that is worse than the model it contains gains nothing, though all but one odd recording may gain
            if best.cost < base.cost:
                # of so many periods it is the best: what the choice among them makes by chance
                gain = gain_of(base, best) - np.log(max(periods[name], 1)) / len(gain)
            if scored is None or not scored.variability or shared(gain) > scored.total:
                scored = Scored(candidate, best, gain, len(candidate.keys), *chances(name, gain))
        assert scored is not None
        found.append(scored)
    return sorted(found, key=lambda s: -s.total)

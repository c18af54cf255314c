"""What a finding does in recordings learnt from and kept away, and whether it stands by that."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from identification.mismatch.comes_again import SELDOM, Again
from identification.mismatch.search import Step
from identification.mismatch.workbench import View

# a finding must cut the comparable squared error by this share where it was learnt, and by this one in recordings kept away
LEARNT, _PROVEN = 0.005, 0.004
# the former where there is one view only, in which everything is larger
LEARNT_PLAINLY = 0.01
# and must not raise their plain rms, rough track and all, by more than this share, and this much of what it cuts there
_WORSE, _LOUD = 0.005, 0.1
# unless it removes this share there, which is plain however much else is missing
_CERTAIN = 0.25
# or must lower it by this factor; what explains less than this share must do both
_BETTER, _SMALL = 0.99, 0.02
# factor of plain rms on recordings kept away that no chance reaches, however little was learnt
_ELSEWHERE = 0.95
# Student's t that few findings by chance reach, and how much worse comparable residuals of recordings kept away may then be
_STEADY, _OPPOSITE = 2.5, 0.01
# of what it removes where it was learnt: what makes comparable residuals of recordings kept away worse by this part is not proven
_AGAINST = 0.5
# Student's t of what is there, under whatever name; and of what recordings kept away show plainly
FORETOLD, _FORETELLING = 2.0, 1.0
# how seldom chance may do as much in the search and point along what comes again
_TOGETHER = 0.001
# what chance reaches too often in the search must explain this much more than the least
_MORE = 2.0
# share that is much for a second finding, and the same of comparable residuals of recordings kept away
_MUCH, _MUCH_KEPT = 0.2, 0.05


@dataclass(frozen=True, eq=False)
class Proof:
    """A finding, and the drive refitted without it against the drive with all.

    Attributes
    ----------
    before, after
        Rms on recordings kept away [mm/s].
    share
        Of the squared error of recordings learnt from that it removes, plainly or among comparable residuals, where it is more.
    learnt, kept
        Share of the comparable squared error that it removes, in recordings learnt from and kept away.
    ratio
        Of plain rms on recordings kept away, after over before, every run with its own dry friction.
    least
        What ``learnt`` must be at least.
    steady
        Student's t of what it removes of each recording learnt from, when both drives are foretold by the other recordings.
    again
        How much of what it foretells recordings kept away show, in every view; empty if that was not asked.
    """

    step: Step
    before: float
    after: float
    share: float
    learnt: float
    kept: float
    ratio: float
    least: float = LEARNT
    steady: float = 0.0
    again: Mapping[View, Again] = field(default_factory=dict)

    @property
    def probability(self) -> float:
        """False-alarm probability: of the search, and for what was only suspected there of both together (R. A. Fisher)."""
        if not self.step.suspected:
            return self.step.probability
        both = self.step.probability * self.again[self.step.view].probability
        return both * (1.0 - float(np.log(both)))

    @property
    def holds(self) -> bool:
        """Whether the finding stands on recordings kept away."""
        if self.step.suspected:
            return (
                self._better
                and self.learnt > _MORE * self.least
                and self._comes_again(_TOGETHER / self.step.probability)
            )
        return self._better or self.certain

    @property
    def certain(self) -> bool:
        """Whether recordings kept away show what was foretold as large as it was, and those learnt from foretell it, too."""
        return self.steady > _FORETELLING and self._comes_again(SELDOM)

    @property
    def beside(self) -> bool:
        """Whether it may stand beside a larger finding, whose law may lack something.

        If it does not explain much, and if that was asked, recordings kept away must show it and not plainly less of it, in one
        view at least. What they show more of is there, too: two effects bend each other's sizes.
        """
        shown = [seen for seen in self.again.values() if seen.probability <= SELDOM and not seen.too_small]
        return self.share >= _MUCH or not self.again or bool(shown)

    @property
    def sized(self) -> bool:
        """Whether the size of what holds differs from none by what recordings foretell of one another, or by those kept away.

        The latter are what makes a suspicion hold.
        """
        return self.steady > _STEADY or self.certain or self.step.suspected

    @property
    def open(self) -> bool:
        """Whether what recordings kept away show of it could still decide."""
        return self.learnt > self.least and self.kept > 0.0 and (self.step.suspected or not self._better)

    def _comes_again(self, level: float) -> bool:
        seen = self.again.get(self.step.view)
        if seen is None or self.learnt <= self.least or self.kept <= 0.0:
            return False
        return seen.probability <= level and seen.as_large and not any(a.too_small for a in self.again.values())

    @property
    def _better(self) -> bool:
        """Whether it is better among comparable residuals of recordings kept away, or plainly there; if it is small, both.

        What is small is let through by chance once in a while: many are tried. Few recordings are kept away: what every recording
        learnt from foretells of the others stands, too, if it lowers the plain rms there and shows no opposite effect.
        """
        worse = self.ratio - 1.0 > _WORSE + _LOUD * self.kept and self.kept < _CERTAIN
        opposite = self.kept <= -max(_OPPOSITE, _AGAINST * self.learnt)
        seen, plain = self.kept > _PROVEN and not worse, self.ratio < _BETTER and not opposite
        plain = plain or (self.steady > _STEADY and self.ratio < 1.0 and self.kept > -_OPPOSITE)
        both = seen and plain if self.share <= _SMALL else seen or plain
        # what is little in the motion it was learnt from may yet decide another motion
        elsewhere = self.learnt > 0.0 and self.kept > _SMALL and self.ratio < _ELSEWHERE
        return elsewhere or (self.learnt > self.least and both)

    @property
    def foretold(self) -> bool:
        """Whether recordings foretell it of one another and those kept away show it, be its name right or not."""
        seen = self.again.get(self.step.view)
        sure = self.steady > FORETOLD or (self.steady > 0.0 and seen is not None and seen.probability <= SELDOM)
        return sure and self.learnt > self.least and self.kept > _PROVEN

    @property
    def plain_beside(self) -> bool:
        """Whether it explains much, or is foretold, or at least that while it removes much of recordings kept away.

        What another name's law lacks does none of these.
        """
        much = self.kept >= _MUCH_KEPT and self.steady > 1.0
        return self.share >= _MUCH or much or self.steady > _STEADY

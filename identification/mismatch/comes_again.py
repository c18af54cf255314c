r"""Does what was found come again in recordings kept away, as large as it was?

A drive with a finding foretells how those recordings differ from a drive without it: :math:`d`, of known shape and size. Their
residual :math:`\varepsilon` holds :math:`a = d^T \varepsilon / d^T d` of it, both without what a refit of the drive takes
out: about one if the finding is right, about none if it was chance. The spread of :math:`a`, and how seldom nuisance
points as much along :math:`d`, are those of random days around the drive without it (:mod:`identification.mismatch.chance`).
The search chose from a whole catalogue; here nothing is left to choose, so little is enough.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from flexdrive_gym.recording import FloatArray, Recording
from identification.mismatch.chance import null_residuals
from identification.mismatch.crew import Crew
from identification.mismatch.prove import placed
from identification.mismatch.refit import with_fresh_sensitivity
from identification.mismatch.screening import orthonormal
from identification.mismatch.settle import absorb, sharpen
from identification.mismatch.shapes import Shape, pushed_by
from identification.mismatch.workbench import Columns, View, Workbench

# draws of nuisance to learn from, and principal directions per recording: few recordings must tell much
_DRAWS, _MODES = 640, 160
# seed of the draws that tell chance: others than those that nuisance is learnt from
_SEED = 22
# how seldom chance may point along what comes again
SELDOM = 0.01
# sizes differ if they do by so many standard deviations, of which this is the least: the first was found with an error, too
_APART, _LEAST_SPREAD = 2.0, 0.2


@dataclass(frozen=True)
class Again:
    """How much of what was foretold recordings kept away show.

    Attributes
    ----------
    size
        Of what was foretold: 1 is as large.
    spread
        Standard deviation of ``size`` by chance.
    probability
        That chance points as much along what was foretold.
    """

    size: float
    spread: float
    probability: float

    @property
    def too_small(self) -> bool:
        """Whether it is plainly smaller than foretold."""
        return self._off < -_APART

    @property
    def as_large(self) -> bool:
        """Whether it may be as large as foretold."""
        return abs(self._off) <= _APART

    @property
    def _off(self) -> float:
        """How far from as large as foretold, in standard deviations."""
        return (self.size - 1.0) / float(np.hypot(self.spread, _LEAST_SPREAD))


class KeptAway:
    """Recordings that neither the search nor a fit saw, asked for what was found without them.

    Parameters
    ----------
    recordings
        At least one.
    """

    def __init__(self, recordings: Sequence[Recording], pool: Crew) -> None:
        self.recordings, self.pool = recordings, pool
        # draws around one drive serve for the others: those that nuisance is learnt from, and those that tell chance
        self._known: tuple[float, Columns] | None = None
        self._null: Columns | None = None

    def comes_again(
        self, without: Mapping[str, float], everything: Mapping[str, float], names: Sequence[str]
    ) -> dict[View, Again]:
        """Return how much of a finding they show, in every view.

        Parameters
        ----------
        without, everything
            The drive without the finding and with it.
        names
            Parameters of the former that a refit may change.
        """
        bench = placed(self.recordings, everything, self.pool, parts=False)
        foretold = bench.residual(without) - bench.residual(everything)
        return self._in_views(bench, without, names, foretold)

    def shape_comes_again(self, values: Mapping[str, float], shape: Shape, names: Sequence[str]) -> dict[View, Again]:
        """Return how much of a free shape, found beside a drive, they show, in every view."""
        bench = placed(self.recordings, values, self.pool, parts=False)
        return self._in_views(bench, values, names, -pushed_by(bench, values, shape))

    def _in_views(
        self, bench: Workbench, values: Mapping[str, float], names: Sequence[str], foretold: FloatArray
    ) -> dict[View, Again]:
        absorb(bench, values)
        model = with_fresh_sensitivity(bench, values, names)
        bench.known = self._known
        sharpen(bench, model, _DRAWS, _MODES)
        if self._null is None or bench.known is not self._known:
            self._known, self._null = bench.known, null_residuals(bench, values, np.random.default_rng(_SEED))
        J, raw = model.sensitivity, bench.residual(values)
        return {view: _again(bench, view, J, raw, foretold, self._null) for view in bench.views}


def _again(bench: Workbench, view: View, J: FloatArray, raw: FloatArray, foretold: FloatArray, null: Columns) -> Again:
    hidden = orthonormal(bench.seen(view, J))
    e, d = (x - hidden @ (hidden.T @ x) for x in (bench.seen(view, y) for y in (raw, foretold)))
    days = bench.seen(view, null)
    lengths = np.sqrt(bench.without(days, hidden))
    square = float(d @ d)
    if not square > 0.0:
        return Again(0.0, float("inf"), 1.0)
    size = float(e @ d) / square
    # of every day its shape, as large as what the finding leaves
    along = (d @ days) / np.maximum(lengths, 1e-300)
    spread = float(np.linalg.norm(e - size * d) * np.sqrt(np.mean(along**2))) / square
    # a day turned round is as likely
    more = np.sum(np.concatenate([along, -along]) >= float(e @ d) / max(float(np.linalg.norm(e)), 1e-300))
    return Again(size, spread, float((1 + more) / (1 + 2 * len(along))))

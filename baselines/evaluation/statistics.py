r"""How sure a comparison over a few training seeds and many drives is.

Learning is random, so an agent is known by several trainings. Their scores on D drives are a table of S rows; what is said of
them is (R. Agarwal, M. Schwarzer, P. S. Castro, A. Courville, M. G. Bellemare, Deep Reinforcement Learning at the Edge of the
Statistical Precipice, NeurIPS 2021)

- the *interquartile mean*, the mean of the middle half of all S·D scores, which no single outlying run moves much;
- a 95 % interval by bootstrap;
- the *probability of improvement*, :math:`P(X < Y) + \tfrac12 P(X = Y)` for a smaller score being better, averaged over
  the drives, on each of which both are measured.

There, each run on each task is a training of its own, and runs are resampled task by task. Here a trained agent meets all drives,
so its scores hang together: whole agents are resampled, and drives apart from them, within each stratum. Resampling cell by cell
would pretend to S·D independent trainings. Five seeds are few, and an interval from so few is rather too narrow.
A controller without a seed has one row; its interval tells of the drives alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from flexdrive_gym.recording import FloatArray

RESAMPLES = 1000
# a run that left all bounds counts as this, so that its sums stay numbers
_FAR = 1e6
# smaller figures are not told apart [mm, V, V mm]
_RESOLVED = 0.001


@dataclass(frozen=True)
class Estimate:
    """A figure with its 95 % interval; all nan where there is nothing to say."""

    value: float
    low: float
    high: float
    resolved: float = _RESOLVED

    def __str__(self) -> str:
        if not np.isfinite(self.value):
            return "–"
        if self.low == self.high:
            return self._figure(self.value)
        return f"{self._figure(self.value)} [{self._figure(self.low)}, {self._figure(self.high)}]"

    def _figure(self, value: float) -> str:
        """Return three digits; what no measure of a run resolves is not spelt out."""
        return f"{value:.3g}" if value == 0.0 or abs(value) >= self.resolved else f"<{self.resolved:.1g}"

    @property
    def percent(self) -> str:
        """The figure as a percentage with its interval."""
        if not np.isfinite(self.value):
            return "–"
        return f"{self.value:.0%}" if self.low == self.high else f"{self.value:.0%} [{self.low:.0%}, {self.high:.0%}]"


NOTHING = Estimate(float("nan"), float("nan"), float("nan"))


def interquartile_mean(scores: npt.ArrayLike) -> FloatArray:
    """Return the mean of the middle half of the last axis; a quarter of the scores, rounded down, goes on either side."""
    from scipy.stats import trim_mean  # noqa: PLC0415  (slow to import)

    return np.asarray(trim_mean(np.asarray(scores, dtype=np.float64), 0.25, axis=-1))


def estimate_iqm(strata: Sequence[npt.ArrayLike], seed: int = 0) -> Estimate:
    """Return the interquartile mean of scores with its interval.

    Parameters
    ----------
    strata
        Tables of scores, ndarray, shape (seeds, drives); all have the same seeds. A drive where a score is nan is left out.
    seed
        Of the bootstrap.

    Raises
    ------
    ValueError
        If the strata do not have the same seeds.
    """
    return _estimate(_clean(strata), interquartile_mean, seed)


def estimate_mean(strata: Sequence[npt.ArrayLike], seed: int = 0) -> Estimate:
    """Return the mean with its interval, for shares; otherwise as :func:`estimate_iqm`."""
    return _estimate(_clean(strata), lambda scores: np.mean(scores, axis=-1), seed)


def probability_of_improvement(
    ours: Sequence[npt.ArrayLike], theirs: Sequence[npt.ArrayLike], seed: int = 0
) -> Estimate:
    """Return how often we have the smaller score on the same drive, a tie counting half.

    Parameters
    ----------
    ours
        Tables of scores, ndarray, shape (seeds, drives), one per stratum.
    theirs
        The same of one run that has no seed, ndarray, shape (1, drives) or (drives,), on the same drives.
    seed
        Of the bootstrap.

    Raises
    ------
    ValueError
        If a stratum has other drives.
    """
    wins = []
    for x, y in zip(ours, theirs, strict=True):
        a, b = np.atleast_2d(np.asarray(x, dtype=np.float64)), np.atleast_2d(np.asarray(y, dtype=np.float64))
        if b.shape != (1, a.shape[1]):
            raise ValueError(
                f"theirs: must be one run on the same drives, shape (1, {a.shape[1]}); got {b.shape}. Pair the drives first."
            )
        both = ~(np.isnan(a).any(axis=0) | np.isnan(b[0]))
        wins.append((np.where(a < b, 1.0, np.where(a == b, 0.5, 0.0)))[:, both])
    return _estimate([w for w in wins if w.shape[1]], lambda scores: np.mean(scores, axis=-1), seed)


def _clean(strata: Sequence[npt.ArrayLike]) -> list[FloatArray]:
    tables = [np.atleast_2d(np.asarray(s, dtype=np.float64)) for s in strata]
    seeds = {len(t) for t in tables}
    if len(seeds) > 1:
        raise ValueError(f"strata: must have the same seeds; got {', '.join(map(str, sorted(seeds)))} of them.")
    kept = [t[:, ~np.isnan(t).any(axis=0)] for t in tables]
    return [np.nan_to_num(t, posinf=_FAR) for t in kept if t.shape[1]]


def _estimate(tables: list[FloatArray], statistic: Callable[[FloatArray], FloatArray], seed: int) -> Estimate:
    """Bootstrap over seeds, common to all strata, and over the drives of each stratum."""
    if not tables:
        return NOTHING
    everyone = [len(tables[0]), *(t.shape[1] for t in tables)]
    drawn = [i for i, n in enumerate(everyone) if n > 1]

    def of(*chosen: Any, axis: int = -1) -> FloatArray:  # noqa: ARG001  (scipy's signature; the last axis it is)
        rows: list[Any] = [np.zeros(1, dtype=np.int64)] * len(everyone)
        for i, places in zip(drawn, chosen, strict=True):
            rows[i] = np.asarray(places, dtype=np.int64)
        parts = []
        for table, columns in zip(tables, rows[1:], strict=True):
            part = table[rows[0][..., :, None], columns[..., None, :]]
            parts.append(part.reshape(*part.shape[:-2], -1))
        lead = np.broadcast_shapes(*(p.shape[:-1] for p in parts))
        return statistic(np.concatenate([np.broadcast_to(p, (*lead, p.shape[-1])) for p in parts], axis=-1))

    value = float(of(*(np.arange(everyone[i]) for i in drawn)))
    if not drawn:
        return Estimate(value, value, value)
    from scipy.stats import bootstrap  # noqa: PLC0415

    found = bootstrap(
        tuple(np.arange(everyone[i]) for i in drawn), of, n_resamples=RESAMPLES, batch=100, vectorized=True,
        method="percentile", rng=np.random.default_rng(seed),
    ).confidence_interval  # fmt: skip
    return Estimate(value, float(found.low), float(found.high))

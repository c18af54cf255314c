"""The null distribution: what the same pipeline finds in data of this rig in which nothing is left out.

A draw is a simulation of the drive around which the noise was told, under everything that is nobody's missing physics: unknown
forces of the estimated intensities, friction and a track that differ from run to run, and encoder counts. (Around another drive a
cart rests at other instants than the noise knows of, and a draw would gain from that.) It goes through the drive's own step, so
what noise does to dry friction is in the draws: it dithers the reversals, for the mean of a non-linear drive is not the drive
of the mean. Every candidate's gain is computed in every draw as it is in the data. Each name is judged by the tail of its own
draws, for a candidate that acts near reversals, or like a slope of the track, gains more in data that lack nothing, and in a
few of them much more: the index of a tail is Hill's (B. M. Hill, Ann. Statist. 3, 1975). The rarest gain of the catalogue gives
the p-value (P. H. Westfall, S. S. Young, Resampling-Based Multiple Testing, 1993: minimum of p-values). Draws end early where
so many have done better that the answer is certain (J. Besag, P. Clifford, Sequential Monte Carlo p-values, Biometrika 78, 1991).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from flexdrive_gym.recording import FloatArray
from identification.mismatch.fitting.bench import SingleArray
from identification.mismatch.noise.estimate import Noise
from identification.mismatch.noise.nuisance import Direction
from identification.mismatch.noise.scatter import scattered
from identification.mismatch.noise.simulator import Simulator
from identification.mismatch.selection.evaluate import Name, Table, evaluate
from identification.mismatch.selection.linear import Linear

# one draw in ten tells the tail of a name's gains: beyond it, the share of draws with a larger gain is a power of it
_OFTEN = 0.9
# least gain that is in a tail: half of what is strong evidence (R. Kass, A. Raftery, Bayes factors, 1995)
_LEAST = 1.5
# index of the tail before any draw, that of half a chi-squared of one degree of freedom beyond 1.5, and the draws it counts for
_INDEX, _COUNTS = 0.4, 8
# draws made at a time, the first of which tell the weights, and those judged by one thread at a time
_CHUNK, _JUDGED = 120, 60
# so many better draws end the series; none in half of the draws ends it, too
_ENOUGH = 15


@dataclass(frozen=True, eq=False)
class Null:
    """Null distribution of a catalogue.

    Attributes
    ----------
    tail
        Every name's gain that one draw in ten exceeds, and the index of the power law beyond it.
    largest : ndarray, shape (draws,)
        Largest score of any name.
    """

    tail: dict[Name, tuple[float, float]]
    largest: FloatArray

    @classmethod
    def over(cls, draws: Sequence[Table]) -> Null:
        """Return the distribution over the draws of several tables."""
        return cls.of({n: np.concatenate([t.total[n] for t in draws]) for n in draws[0].total})

    @classmethod
    def of(cls, gain: Mapping[Name, FloatArray]) -> Null:
        """Return the distribution from every name's gains over the draws."""
        tail = {}
        for name, g in gain.items():
            often = max(float(np.quantile(g, _OFTEN)), _LEAST)
            more = np.log(g[g > often] / often)
            tail[name] = often, float((more.sum() + _COUNTS * _INDEX) / (len(more) + _COUNTS))
        return cls(tail, np.max([_score(g, *tail[n]) for n, g in gain.items()], axis=0))

    def score(self, name: Name, gain: float) -> float:
        """Return how rare a gain is under a name's own null distribution: decades beyond one draw in ten, negative below."""
        return float(_score(np.array(gain), *self._tail(name)))

    def rarity(self, name: Name, gain: float) -> float:
        """Return the share of draws in which some gain of the catalogue is as rare."""
        return float((1 + np.sum(self.largest >= self.score(name, gain))) / (len(self.largest) + 1))

    def p_value(self, name: Name, gain: float) -> float:
        """Return how often the best of the catalogue gains as much where nothing is left out: at most so often.

        A gain in prediction is the logarithm of a likelihood ratio, which reaches x by chance in no more than one data set in x
        (V. Vovk, R. Wang, Ann. Statist. 49, 2021), and there are so many names to choose from. Draws are as good as the model of
        the noise, and know first-order gains alone; this holds for any, so the larger of the two is the p-value.
        """
        return max(self.rarity(name, gain), float(min(1.0, len(self.tail) * np.exp(-max(gain, 0.0)))))

    def needed(self, name: Name, level: float) -> float:
        """Return the least gain of a name whose p-value is at most a level; ``inf`` where there are too few draws for it."""
        better = int(level * (len(self.largest) + 1)) - 1
        if better < 0:
            return float("inf")
        score = float(np.sort(self.largest)[::-1][better]) if better < len(self.largest) else -np.inf
        return float(max(_gain(score, *self._tail(name)), np.log(len(self.tail) / level)))

    def _tail(self, name: Name) -> tuple[float, float]:
        """Return a name's tail, that of the median name where it was in no draw."""
        often, index = self.tail.get(name) or np.median(list(self.tail.values()), axis=0)
        return float(often), float(index)


def _score(gain: FloatArray, often: float, index: float) -> FloatArray:
    """Return the decades by which a gain is rarer than the one of one draw in ten; below that, the share of it over one."""
    relative = gain / often
    return np.where(relative > 1.0, np.log10(np.maximum(relative, 1.0)) / index, relative - 1.0)


def _gain(score: float, often: float, index: float) -> float:
    """Return the gain that has a score: the inverse of :func:`_score`."""
    return often * (10.0 ** (index * score) if score > 0.0 else 1.0 + score)


def first_draws(
    noise: Noise, found: Sequence[Direction], left: FloatArray, seed: Sequence[int]
) -> tuple[Noise, SingleArray]:
    """Return the noise with the weights that simulations of it and unexplained rows tell, and their whitened rows.

    Returns
    -------
    Noise
    ndarray, shape (N, draws)
    """
    raw = Simulator(noise.bench, noise.values, noise, found).rows(range(_CHUNK), seed)
    noise = scattered(noise, raw, left, found)
    return noise, noise.white(raw, noise.bench.pool.map)


def null_of(
    linear: Linear,
    noise: Noise,
    found: Sequence[Direction],
    first: SingleArray,
    data: Table,
    seed: Sequence[int],
) -> Null:
    """Draw the null distribution of gains.

    Parameters
    ----------
    linear
        All candidates around the present model.
    found
        Run-to-run variability.
    first : ndarray, shape (N, draws)
        Whitened rows of draws made already.
    data
        Gains in the data, which tell when draws are enough.
    seed
        Of the draws.
    """
    bench = linear.bench
    gains: list[Table] = judged(linear, first)
    simulator, made = Simulator(noise.bench, noise.values, noise, found), first.shape[1]
    while True:
        null = Null.over(gains)
        best = min(null.rarity(n, float(own[0])) for n, own in data.total.items())
        most = bench.settings.draws
        if made >= most or best * (made + 1) > _ENOUGH or (made >= most // 2 and best * (made + 1) <= 1.0):
            return null
        rows = noise.white(simulator.rows(range(made, made + _CHUNK), seed), bench.pool.map)
        gains += judged(linear, rows)
        made += _CHUNK


def judged(linear: Linear, rows: SingleArray) -> list[Table]:
    """Return every candidate's gain in whitened rows of draws, shape (N, draws), some draws in each table."""
    parts = [rows[:, i : i + _JUDGED] for i in range(0, rows.shape[1], _JUDGED)]
    return list(linear.bench.pool.map(partial(evaluate, linear), parts))

"""The null distribution: what the same pipeline finds in data of this rig in which nothing is left out.

A draw is a simulation of the present model under everything that is nobody's missing physics: unknown forces of the estimated
intensities, friction and a track that differ from run to run, and encoder counts. It goes through the drive's own step,
so what noise does to dry friction is in the draws: it dithers the reversals, for the mean of a non-linear drive is not the drive
of the mean. Every candidate's gain is computed in every draw as it is in the data. Each name is judged by the tail of its own
draws, for a candidate that acts near reversals, or like a slope of the track, gains more in data that lack nothing, and in a
few of them much more: the index of a tail is Hill's (B. M. Hill, Ann. Statist. 3, 1975). The rarest gain of the catalogue gives
the p-value (P. H. Westfall, S. S. Young, Resampling-Based Multiple Testing, 1993: minimum of p-values). Draws end early where
so many have done better that the answer is certain (J. Besag, P. Clifford, Sequential Monte Carlo p-values, Biometrika 78, 1991).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from flexdrive_gym.recording import FloatArray
from identification.mismatch.fitting.bench import Bench, SingleArray, Values
from identification.mismatch.noise.estimate import Noise
from identification.mismatch.noise.friction import moving
from identification.mismatch.noise.nuisance import Direction, drawn
from identification.mismatch.noise.scatter import scattered
from identification.mismatch.selection.evaluate import Name, Table, evaluate
from identification.mismatch.selection.linear import Linear

# one draw in ten tells the tail of a name's gains: beyond it, the share of draws with a larger gain is a power of it
_OFTEN = 0.9
# least gain that is in a tail: half of what is strong evidence (R. Kass, A. Raftery, Bayes factors, 1995)
_LEAST = 1.5
# index of the tail before any draw, that of half a chi-squared of one degree of freedom beyond 1.5, and the draws it counts for
_INDEX, _COUNTS = 0.4, 8
# draws made at a time, and the first of them, which tell the weights
_CHUNK, _FIRST = 60, 120
# draws simulated by one thread at a time
_GROUP = 20
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
        often, index = self.tail.get(name) or np.median(list(self.tail.values()), axis=0)
        return float(_score(np.array(gain), float(often), float(index)))

    def p_value(self, name: Name, gain: float) -> float:
        """Return how often the best of the catalogue gains as much where nothing is left out."""
        return float((1 + np.sum(self.largest >= self.score(name, gain))) / (len(self.largest) + 1))

    def evidence(self, level: float) -> float:
        """Return the gain that the best of the catalogue must have, whatever the draws say.

        A gain in prediction is the logarithm of a likelihood ratio, which reaches x by chance in no more than one data set in x
        (V. Vovk, R. Wang, Ann. Statist. 49, 2021), and there are so many names to choose from. Draws are as good as the model of
        the noise; this holds for any.
        """
        return float(np.log(len(self.tail) / level))


def _score(gain: FloatArray, often: float, index: float) -> FloatArray:
    """Return the decades by which a gain is rarer than the one of one draw in ten; below that, the share of it over one."""
    relative = gain / often
    return np.where(relative > 1.0, np.log10(np.maximum(relative, 1.0)) / index, relative - 1.0)


def first_draws(
    bench: Bench, values: Values, noise: Noise, found: Sequence[Direction], left: FloatArray, seed: Sequence[int]
) -> tuple[Noise, SingleArray]:
    """Return the noise with the weights that simulations of it and unexplained rows tell, and their whitened rows.

    Returns
    -------
    Noise
    ndarray, shape (N, draws)
    """
    raw = simulated(bench, values, noise, found, range(_FIRST), seed)
    noise = scattered(noise, raw, left, found)
    return noise, noise.white(raw, bench.pool.map)


def null_of(
    linear: Linear,
    values: Values,
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
    values
        Present model.
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
    gains: list[Table] = [evaluate(linear, first)]
    made = first.shape[1]
    while True:
        null = Null.of({n: np.concatenate([t.total[n] for t in gains]) for n in data.total})
        best = min(null.p_value(n, float(own[0])) for n, own in data.total.items())
        most = bench.settings.draws
        if made >= most or best * (made + 1) > _ENOUGH or (made >= most // 2 and best * (made + 1) <= 1.0):
            return null
        more = simulated(bench, values, noise, found, range(made, made + _CHUNK), seed)
        rows = noise.white(more, bench.pool.map)
        gains.append(evaluate(linear, rows))
        made += _CHUNK


def simulated(
    bench: Bench, values: Values, noise: Noise, found: Sequence[Direction], draws: range, seed: Sequence[int]
) -> SingleArray:
    """Return rows of simulated data sets against the drive itself, shape (N, draws)."""
    here = bench.residual(values, [np.zeros((2, len(run.u))) for run in bench.runs])
    forces = [d.force for d in found if d.force is not None]
    pushing = [i for i, d in enumerate(found) if d.force is not None]
    moved = [(i, d.change) for i, d in enumerate(found) if d.force is None]
    shapes = [
        np.array([force(r) for force in forces], dtype=np.float32).reshape(len(forces), 2 * len(run.u))
        for r, run in enumerate(bench.runs)
    ]
    # what disturbs a cart is friction for the most part: at rest it holds, as the recordings show
    moves = [
        np.array([moving(x, run.sample_time, positions=True) != 0.0 for x in run.track], dtype=np.float32)
        for run in bench.runs
    ]

    def group(first: int) -> FloatArray:
        rngs = [np.random.default_rng([*seed, draw]) for draw in draws[first : first + _GROUP]]
        amplitudes = [drawn(found, noise.scale, len(bench.runs), 1, rng)[0] for rng in rngs]
        # one product for all draws of a group
        pushes = [
            np.array([a[r, pushing] for a in amplitudes], dtype=np.float32) @ shapes[r] for r in range(len(bench.runs))
        ]
        return np.column_stack(
            [
                one(rng, a, [p[i] for p in pushes]).astype(np.float32)
                for i, (rng, a) in enumerate(zip(rngs, amplitudes, strict=True))
            ]
        )

    def one(rng: np.random.Generator, amplitude: FloatArray, push: list[FloatArray]) -> FloatArray:
        total = [
            np.asarray(
                _forces(noise, r, len(run.u), run.sample_time, rng) * moves[r] + push[r].reshape(2, -1),
                dtype=np.float64,
            )
            for r, run in enumerate(bench.runs)
        ]
        rows = here - bench.residual(values, total) + _rounding(bench, rng)
        for i, change in moved:
            for r, own in enumerate(bench.rows):
                rows[own] += change[own] * amplitude[r, i]
        return np.asarray(rows * bench.valid)

    return np.column_stack(list(bench.pool.map(group, range(0, len(draws), _GROUP))))


def _forces(noise: Noise, r: int, n: int, h: float, rng: np.random.Generator) -> FloatArray:
    """Return unknown forces on both carts, shape (2, n) [V]."""
    own, keep = float(noise.own[r]), float(np.exp(-h / noise.forces.time_s))
    white, drive = rng.standard_normal((2, 2, n), dtype=np.float32)
    # stationary from the start
    drive[:, 1:] *= np.float32(np.sqrt(1.0 - keep**2))
    slow = lfilter(np.ones(1, np.float32), np.array([1.0, -keep], np.float32), drive)
    size = [own * np.array(s, dtype=np.float32)[:, None] for s in (noise.forces.white, noise.forces.slow)]
    return np.asarray(np.float32(1.0 / np.sqrt(h)) * size[0] * white + size[1] * slow)


def _rounding(bench: Bench, rng: np.random.Generator) -> FloatArray:
    """Return what encoder counts add to the rows."""
    found = np.zeros(len(bench.valid))
    for p in bench.pieces:
        run = bench.runs[p.recording]
        size = float(np.sqrt(bench.rounding[run.name][p.cart]))
        n = p.rows.stop - p.rows.start
        error = size * np.sqrt(3.0) * rng.uniform(-1.0, 1.0, n + 1)
        found[p.rows] = error[1:] if run.positions else np.diff(error) / (run.block * run.sample_time)
    return found

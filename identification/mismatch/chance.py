r"""What chance reaches: the same rig with nothing left out, but as restless as real rigs are.

Even a perfect model leaves an error on a real rig: friction differs from run to run and wanders within a run, the track is
rough, and something always shakes. Each such nuisance is coloured by the drive and locked to its motion, so it resembles
missing physics far more than white noise does. *Null draws* simulate the present model with random nuisance forces

.. math:: F_c(t) = -\operatorname{sgn}(v_c)\, d_c \left(a_r + w_c(t) + h_c(x_c(t) + x_{0r})\right) + n_c(t),

with :math:`a_r` one number per run, :math:`w_c` an Ornstein-Uhlenbeck process, :math:`h_c` one random profile of the track that
every run meets from its own starting place, near the others or far from them, and :math:`n_c` band-limited noise and forces along
the track: short hills and a slow slope, which have such profiles too. Gains are shares, so only the mixture matters;
it is drawn anew for every draw: the spread between runs about what these recordings show, the rest over the range seen on two
rigs. The gain of every candidate in every draw, relative to
what that candidate usually reaches by chance, has a maximum over the catalogue; the share of draws in which it exceeds the
observed one is the false-alarm probability of a search over everything (P. H. Westfall, S. S. Young, Resampling-based
multiple testing, 1993).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np

from flexdrive_gym.drive.compilation import inlined, kernel
from flexdrive_gym.recording import FloatArray
from identification.mismatch.refit import Fit
from identification.mismatch.screening import Screened, explained, orthonormal
from identification.mismatch.surroundings import against, dry_level, speeds
from identification.mismatch.workbench import Columns, Disturbance, View, Workbench

DRAWS = 119
# a candidate that chance hardly feeds must still explain something
_USUAL = 1e-3
# spreads relative to the Coulomb level, correlation length of the track [mm], noise [V]: lowest and highest
_ABOUT, _WITHIN, _ROUGH = (0.7, 1.4), (0.02, 0.09), (0.02, 0.14)
_LENGTH_MM, _NOISE_V = (3.0, 60.0), (0.015, 0.08)
_SLOPE_MM = (20.0, 200.0)
# short hills of the track [V]: long ones are slopes
_HILLS_V, _HILLS_MM = (0.005, 0.03), (3.0, 10.0)
_WANDER_S, _BAND_HZ = 2.0, 50.0
# a cart is put back about where it was, or runs on along the track
_START_MM = (25.0, 150.0)
_TRACK_MM = np.linspace(-250.0, 250.0, 501)
_REACH_MM = 400.0
# points of a profile, and time between joints of what is smooth
_PER_MM, _JOINT_S = 1.0, 0.003
# candidates that a thread looks at together
_PART = 32
# of a run's dry friction, relative
_LEAST_FRICTION = 0.2
# slow friction is drawn once in so many samples
_COARSE = 50


@dataclass(frozen=True, eq=False)
class Chance:
    """Gains in null draws, of the best entry of every effect and place.

    Attributes
    ----------
    names
        Effect and place.
    gains : ndarray, shape (draws, names, views)
        Shares of the null's error explained.
    usual : ndarray, shape (names, views)
        What it reaches in the luckiest tenth of draws, on average.
    """

    names: tuple[tuple[str, str], ...]
    gains: FloatArray
    usual: FloatArray

    @classmethod
    def of(cls, names: Sequence[tuple[str, str]], gains: FloatArray) -> Chance:
        """Return what chance reaches by gains in null draws, shape (draws, names, views)."""
        return cls(tuple(names), gains, np.maximum(_usual(gains), _USUAL))

    def probability(self, name: tuple[str, str], gains: Sequence[float] | FloatArray) -> float:
        """Return the probability that anything does, by chance, as well against its usual in any view as this one did."""
        return float((1 + np.sum(self._most >= max(self.surprise(name, gains)))) / (1 + len(self._most)))

    @property
    def lucky(self) -> float:
        """The greatest surprise that anything is in the luckiest tenth of draws."""
        return float(np.quantile(self._most, 0.9))

    @cached_property
    def _most(self) -> FloatArray:
        return np.asarray(np.max(_odds(self.gains) / _odds(self.usual), axis=(1, 2)))

    def surprise(self, name: tuple[str, str], gains: Sequence[float] | FloatArray) -> tuple[float, ...]:
        """Return the odds of a gain in every view, relative to those that the effect usually reaches by chance.

        Odds, explained over left, because what chance feeds often cannot exceed its usual share by much: a share ends at one.
        """
        return tuple(map(float, _odds(np.array(gains)) / _odds(self.usual[self.names.index(name)])))


def _usual(gains: FloatArray) -> FloatArray:
    """Return the share whose odds are the mean of the highest tenth of draws: the odds of one draw alone are too uncertain."""
    most = np.sort(_odds(gains), axis=0)[-max(len(gains) // 10, 1) :].mean(axis=0)
    return np.asarray(most / (1.0 + most))


def _odds(gain: Any) -> Any:
    return gain / (1.0 - np.minimum(gain, 0.999))


def null_residuals(
    bench: Workbench, values: Mapping[str, float], rng: np.random.Generator, draws: int = DRAWS
) -> Columns:
    """Return raw residuals of the present model under random nuisance, shape (N, draws)."""
    signs = list(zip(*([against(v) for v in speeds(bench, c)] for c in range(len(bench.runs[0].keep))), strict=True))
    days = [partial(nuisance, bench, values, signs, seed) for seed in (int(s) for s in rng.integers(0, 2**63, draws))]
    # side by side
    found: FloatArray
    found, counts = bench.pool.map(
        lambda make: make(), [partial(bench.disturbed, values, days), partial(_counts, bench, rng, draws)]
    )
    found += counts
    return found.astype(np.float32)


def _counts(bench: Workbench, rng: np.random.Generator, draws: int) -> FloatArray:
    """Return what encoder counts do to block means, shape (N, draws): a mean velocity is a difference of two positions."""
    noise = np.zeros((len(bench.weights), draws))
    for r, run in enumerate(bench.runs):
        if run.cutoff:  # a filter has taken them out
            continue
        for c, count in enumerate(run.counts):
            piece = bench.piece(r, c)
            rounding = count * rng.uniform(-0.5, 0.5, (piece.stop - piece.start + 1, draws))
            noise[piece] = rounding[1:] if run.positions else np.diff(rounding, axis=0) / (run.block * run.sample_time)
    return noise


def chance(
    bench: Workbench, screened: Mapping[View, Sequence[Screened]], null: FloatArray | Columns, model: Fit
) -> Chance:
    """Return what every candidate explains of null residuals.

    Parameters
    ----------
    screened
        The same candidates in every view.
    null
        Raw residuals, shape (N, draws).
    model
        Whose directions a refit takes out.
    """
    views = []
    for view, entries in screened.items():
        present = orthonormal(bench.seen(view, model.sensitivity))
        e = bench.seen(view, null)
        total = np.maximum(bench.without(e, present), 1e-300)
        narrow = e.astype(np.float32)
        parts = [entries[i : i + _PART] for i in range(0, len(entries), _PART)]
        shares = [
            found / total
            for part in bench.pool.map(lambda p, e=narrow: explained(bench, p, e), parts)
            for found in part
        ]
        names = tuple(dict.fromkeys(s.candidate.name for s in entries))
        views.append(
            [np.max([g for g, s in zip(shares, entries, strict=True) if s.candidate.name == n], axis=0) for n in names]
        )
    return Chance.of(names, np.moveaxis(np.array(views), 2, 0).swapaxes(1, 2))


def nuisance(
    bench: Workbench, values: Mapping[str, float], signs: Sequence[Sequence[FloatArray]], seed: int
) -> list[Disturbance]:
    """Return one draw of a day's nuisance, for every recording; ``signs`` are those of dry friction."""
    rng = np.random.default_rng(seed)
    # what differs from run to run was estimated from these very recordings; the rest varies over what rigs show
    between = bench.spread.get("friction", 0.05) * _log_uniform(rng, *_ABOUT)
    within, rough = (_log_uniform(rng, *limits) for limits in (_WITHIN, _ROUGH))
    length, noise = _log_uniform(rng, *_LENGTH_MM), _log_uniform(rng, *_NOISE_V)
    carts = len(bench.runs[0].keep)
    profiles = [_Profile(rng, length) for _ in range(carts)]
    hills = [_Profile(rng, _log_uniform(rng, *_HILLS_MM)) for _ in range(carts)]
    height = _log_uniform(rng, *_HILLS_V)
    # half of it: friction along the track makes constant forces too
    slope = 0.5 * bench.spread.get("offset", 0.005) * _log_uniform(rng, *_ABOUT)
    slopes = [_Profile(rng, _log_uniform(rng, *_SLOPE_MM)) for _ in range(carts)]
    days = []
    apart = _log_uniform(rng, *_START_MM)
    start = apart * rng.standard_normal()
    # what all parts of one recording share is no difference between them: a friction or a slope that chance could make there
    # would be a property of the drive
    ways = (
        [np.concatenate([r.track[c] for r in bench.runs]) + start for c in range(carts)]
        if bench.parts
        else [_TRACK_MM] * carts
    )
    # and so would a slope be that the whole track has
    shared = [profile.mean(way) for profile, way in zip(slopes, ways, strict=True)]
    for run, sign in zip(bench.runs, signs, strict=True):
        n, h = len(run.u), run.sample_time
        force, dry = np.zeros((2, n)), {}
        if not bench.parts:
            start = apart * rng.standard_normal()
        # all but the sign of a velocity is smooth: it is made at joints and straight between them
        step = max(1, round(_JOINT_S / h))
        joints = -(-n // step) + 1
        coarse = max(1, round(0.5 / _BAND_HZ / h))
        for c in range(carts):
            way = run.track[c][np.minimum(np.arange(joints) * step, n - 1)] + start
            keep = np.exp(-_COARSE * h / _WANDER_S)
            steps = rng.standard_normal(joints * step // _COARSE + 2)
            own = 0.0 if bench.parts else between * rng.standard_normal()
            # what differs from run to run holds resting carts, too
            level, coulomb = dry_level(values, c), values.get(f"d{c + 1}", 0.0)
            dry[f"d{c + 1}"] = coulomb * max(1.0 + own, _LEAST_FRICTION)
            knots = rng.standard_normal(joints * step // coarse + 2)
            low, high = float(way.min()), float(way.max())
            track, short, long = (profile.table(low, high) for profile in (profiles[c], hills[c], slopes[c]))
            _draw_force(
                step, way, keep, steps, _COARSE, knots, coarse, track, short, long, level, within, rough, (level - coulomb) * own,
                noise, slope, shared[c], height, sign[c], force[c],
            )  # fmt: skip
        days.append(Disturbance(force, dry))
    return days


@inlined
def _at(place: float, values: Any) -> float:
    """Return the value between points at whole places, and that of the first or last beyond them."""
    last = len(values) - 1
    place = min(max(place, 0.0), float(last))
    below = min(int(place), last - 1)
    return float(values[below] + (place - below) * (values[below + 1] - values[below]))


@inlined
def _along(x: float, table: Any) -> float:
    """Return a function of position from its table: first place, spacing, and values, straight between and constant beyond."""
    first, step, values = table
    return _at((x - first) / step, values)


@kernel
def _all_along(x: Any, table: Any) -> Any:
    """Return the values of such a function at many positions."""
    found = np.empty(len(x))
    for i in range(len(x)):
        found[i] = _along(x[i], table)
    return found


@kernel
def _draw_force(
    step: int,
    way: Any,
    keep: float,
    steps: Any,
    per_step: int,
    knots: Any,
    per_knot: int,
    track: Any,
    hills: Any,
    slopes: Any,
    level: float,
    within: float,
    rough: float,
    own: float,
    noise: float,
    slope: float,
    shared: float,
    height: float,
    sign: Any,
    out: Any,
) -> None:
    """Write the force on one cart [V]: drawn at joints every ``step`` samples, and straight between them but for friction's sign.

    ``way`` is where the cart is at the joints [mm]; ``steps`` drive friction that wanders, and ``knots`` are noise, one in
    ``per_step`` and ``per_knot`` samples; rough track, hills and slopes are tables.
    """
    slow, gain, last = np.empty(len(steps)), np.sqrt(1.0 - keep**2), 0.0
    for i in range(len(steps)):
        last = keep * last + gain * steps[i]
        slow[i] = last
    push, friction = np.empty(len(way)), np.empty(len(way))
    for j in range(len(way)):
        wander = _at(j * step / per_step, slow)
        friction[j] = level * (within * wander + rough * _along(way[j], track)) + own
        tilted, hilly = slope * (_along(way[j], slopes) - shared), height * _along(way[j], hills)
        push[j] = noise * _at(j * step / per_knot, knots) + (tilted + hilly)
    for j in range(len(way) - 1):
        pushes_more, rubs_more = push[j + 1] - push[j], friction[j + 1] - friction[j]
        for i in range(j * step, min((j + 1) * step, len(out))):
            part = i / step - j
            out[i] = (push[j] + part * pushes_more) + sign[i] * (friction[j] + part * rubs_more)


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


class _Profile:
    """A random stationary function of position with unit variance: a sum of waves of random length."""

    def __init__(self, rng: np.random.Generator, length: float, waves: int = 40) -> None:
        self.k = rng.standard_normal(waves) / length
        self.phase = rng.uniform(0.0, 2.0 * np.pi, waves)
        self.grid: FloatArray = np.zeros(0)
        self.values: FloatArray = np.zeros(0)

    def table(self, low: float, high: float) -> tuple[float, float, FloatArray]:
        """Return its first place, its spacing [mm] and its values, which reach from ``low`` to ``high`` at least."""
        if not len(self.grid) or low < self.grid[0] or high > self.grid[-1]:
            # drawn where runs have been so far, and some way beyond
            reach = max(_REACH_MM, 1.2 * abs(low), 1.2 * abs(high))
            self.grid = np.linspace(-reach, reach, round(_PER_MM * 2.0 * reach) + 1)
            self.values = np.sqrt(2.0 / len(self.k)) * self._waves(-reach, self.grid[1] - self.grid[0], len(self.grid))
        return float(self.grid[0]), float(self.grid[1] - self.grid[0]), self.values

    def mean(self, x: FloatArray) -> float:
        """Return its mean over places [mm]."""
        return float(np.mean(_all_along(x, self.table(float(x.min()), float(x.max())))))

    def _waves(self, first: float, step: float, count: int) -> FloatArray:
        """Return the sum of all cosines at equal distances, by their angles' sums: coarse places, and fine ones beyond each."""
        fine = int(np.ceil(np.sqrt(count)))
        coarse = -(-count // fine)
        a = self.k * (first + step * fine * np.arange(coarse)[:, None]) + self.phase
        b = self.k * (step * np.arange(fine)[:, None])
        return np.asarray(np.cos(a) @ np.cos(b).T - np.sin(a) @ np.sin(b).T).ravel()[:count]

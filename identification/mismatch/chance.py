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
from functools import partial
from typing import Any

import numpy as np
from scipy.signal import lfilter

from flexdrive_gym.recording import FloatArray
from identification.mismatch.refit import Fit
from identification.mismatch.screening import Screened, explained, orthonormal
from identification.mismatch.surroundings import against, dry_level, speeds
from identification.mismatch.workbench import View, Workbench

DRAWS = 119
# spreads relative to the Coulomb level, correlation length of the track [mm], noise [V]: lowest and highest
_ABOUT, _WITHIN, _ROUGH = (0.7, 1.4), (0.01, 0.06), (0.005, 0.06)
_LENGTH_MM, _NOISE_V = (3.0, 60.0), (0.01, 0.05)
_SLOPE_MM = (20.0, 200.0)
# short hills of the track [V]: long ones are slopes
_HILLS_V, _HILLS_MM = (0.003, 0.015), (3.0, 10.0)
_WANDER_S, _BAND_HZ = 2.0, 50.0
# a cart is put back about where it was, or runs on along the track
_START_MM = (25.0, 150.0)
_TRACK_MM = np.linspace(-250.0, 250.0, 501)
_REACH_MM = 400.0
# candidates that a thread looks at together
_PART = 32
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
        What it reaches in one draw of thirty.
    """

    names: tuple[tuple[str, str], ...]
    gains: FloatArray
    usual: FloatArray

    def probability(self, name: tuple[str, str], gains: Sequence[float] | FloatArray) -> float:
        """Return the probability that anything does, by chance, as well against its usual in any view as this one did."""
        most = np.max(_odds(self.gains) / _odds(self.usual), axis=(1, 2))
        return float((1 + np.sum(most >= max(self.surprise(name, gains)))) / (1 + len(most)))

    def surprise(self, name: tuple[str, str], gains: Sequence[float] | FloatArray) -> tuple[float, ...]:
        """Return the odds of a gain in every view, relative to those that the effect usually reaches by chance.

        Odds, explained over left, because what chance feeds often cannot exceed its usual share by much: a share ends at one.
        """
        return tuple(map(float, _odds(np.array(gains)) / _odds(self.usual[self.names.index(name)])))


def _odds(gain: Any) -> Any:
    return gain / (1.0 - np.minimum(gain, 0.999))


def null_residuals(
    bench: Workbench, values: Mapping[str, float], rng: np.random.Generator, draws: int = DRAWS
) -> FloatArray:
    """Return raw residuals of the present model under random nuisance, shape (N, draws)."""
    motion = list(zip(*(speeds(bench, c) for c in range(len(bench.runs[0].keep))), strict=True))
    forces = [
        partial(nuisance, bench, values, motion, seed) for seed in (int(s) for s in rng.integers(0, 2**63, draws))
    ]
    return bench.pushed(values, forces, 1.0)


def chance(bench: Workbench, screened: Mapping[View, Sequence[Screened]], null: FloatArray, model: Fit) -> Chance:
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
        e -= present @ (present.T @ e)
        total = np.maximum(np.sum(e**2, axis=0), 1e-300)
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
    gains = np.moveaxis(np.array(views), 2, 0).swapaxes(1, 2)
    # a candidate that chance hardly feeds must still explain something
    return Chance(names, gains, np.maximum(np.quantile(gains, 0.97, axis=0), 4e-3))


def nuisance(
    bench: Workbench, values: Mapping[str, float], motion: Sequence[Sequence[FloatArray]], seed: int
) -> list[FloatArray]:
    """Return one draw of nuisance forces, for every recording ndarray, shape (2, n) [V]; ``motion`` are smoothed velocities."""
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
    pushes = []
    apart = _log_uniform(rng, *_START_MM)
    start = apart * rng.standard_normal()
    # what all parts of one recording share is no difference between them: a friction or a slope that chance could make there
    # would be a property of the drive
    ways = [np.concatenate([r.track[c] for r in bench.runs]) + start for c in range(carts)]
    # and so would a slope be that the whole track has
    shared = [
        float(np.mean(profile(way if bench.parts else _TRACK_MM))) for profile, way in zip(slopes, ways, strict=True)
    ]
    for run, speed in zip(bench.runs, motion, strict=True):
        n, h = len(run.u), run.sample_time
        force = np.zeros((2, n))
        if not bench.parts:
            start = apart * rng.standard_normal()
        for c in range(carts):
            v = speed[c]
            keep = np.exp(-_COARSE * h / _WANDER_S)
            slow = lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], rng.standard_normal(n // _COARSE + 2))
            wander = np.interp(np.arange(n) / _COARSE, np.arange(n // _COARSE + 2), slow)
            own = 0.0 if bench.parts else between * rng.standard_normal()
            friction = own + within * wander + rough * profiles[c](run.track[c] + start)
            coarse = max(1, round(0.5 / _BAND_HZ / h))
            shake = np.interp(np.arange(n) / coarse, np.arange(n // coarse + 2), rng.standard_normal(n // coarse + 2))
            force[c] = noise * shake
            force[c] += slope * (slopes[c](run.track[c] + start) - shared[c]) + height * hills[c](run.track[c] + start)
            force[c] += against(v) * dry_level(values, c) * friction
        pushes.append(force)
    return pushes


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


class _Profile:
    """A random stationary function of position with unit variance: a sum of waves of random length."""

    def __init__(self, rng: np.random.Generator, length: float, waves: int = 40) -> None:
        self.k = rng.standard_normal(waves) / length
        self.phase = rng.uniform(0.0, 2.0 * np.pi, waves)
        self.grid: FloatArray = np.zeros(0)
        self.values: FloatArray = np.zeros(0)

    def __call__(self, x: FloatArray) -> FloatArray:
        low, high = float(x.min()), float(x.max())
        if not len(self.grid) or low < self.grid[0] or high > self.grid[-1]:
            # drawn where runs have been so far, and some way beyond
            reach = max(_REACH_MM, 1.2 * abs(low), 1.2 * abs(high))
            self.grid = np.linspace(-reach, reach, round(4.0 * reach) + 1)
            waves = np.cos(self.k[:, None] * self.grid + self.phase[:, None])
            self.values = np.sqrt(2.0 / len(self.k)) * waves.sum(axis=0)
        return np.asarray(np.interp(x, self.grid, self.values))

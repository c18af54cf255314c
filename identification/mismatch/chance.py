r"""What chance reaches: the same rig with nothing left out, but as restless as real rigs are.

Even a perfect model leaves an error on a real rig: friction differs from run to run and wanders within a run, the track is
rough, and something always shakes. Each such nuisance is coloured by the drive and locked to its motion, so it resembles
missing physics far more than white noise does. *Null draws* simulate the present model with random nuisance forces

.. math:: F_c(t) = -\operatorname{sgn}(v_c)\, d_c \left(a_r + w_c(t) + h_c(x_c(t) + x_{0r})\right) + n_c(t),

with :math:`a_r` one number per run, :math:`w_c` an Ornstein-Uhlenbeck process, :math:`h_c` one random profile of the track that
every run meets from its own starting place, and :math:`n_c` band-limited noise and the slope of the track, which has such a
profile too. Gains are shares, so only the mixture matters;
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
from scipy.ndimage import gaussian_filter1d
from scipy.signal import lfilter

from flexdrive_gym.recording import FloatArray
from identification.mismatch.screening import Screened
from identification.mismatch.workbench import Workbench

DRAWS = 119
# spreads relative to the Coulomb level, correlation length of the track [mm], noise [V]: lowest and highest
_ABOUT, _WITHIN, _ROUGH = (0.7, 1.4), (0.01, 0.06), (0.005, 0.06)
_LENGTH_MM, _NOISE_V = (3.0, 60.0), (0.01, 0.05)
_SLOPE_MM = (20.0, 200.0)
_WANDER_S, _BAND_HZ, _START_MM = 2.0, 50.0, 150.0
_RESTING = 5.0
# slow friction is drawn once in so many samples
_COARSE = 50


@dataclass(frozen=True, eq=False)
class Chance:
    """Gains in null draws, of the best entry of every effect and place.

    Attributes
    ----------
    names
        Effect and place.
    gains : ndarray, shape (draws, names)
        Shares of the null's error explained.
    usual : ndarray, shape (names,)
        What it reaches in one draw of thirty.
    """

    names: tuple[tuple[str, str], ...]
    gains: FloatArray
    usual: FloatArray

    def probability(self, name: tuple[str, str], gain: float) -> float:
        """Return the probability that anything does, by chance, as well against its usual as this one did."""
        most = np.max(_odds(self.gains) / _odds(self.usual), axis=1)
        return float((1 + np.sum(most >= self.surprise(name, gain))) / (1 + len(most)))

    def surprise(self, name: tuple[str, str], gain: float) -> float:
        """Return the odds of a gain, explained over left, relative to those that the effect usually reaches by chance.

        Odds, because what chance feeds often cannot exceed its usual share by much: a share ends at one.
        """
        return float(_odds(gain) / _odds(self.usual[self.names.index(name)]))


def _odds(gain: Any) -> Any:
    return gain / (1.0 - np.minimum(gain, 0.999))


def null_residuals(
    bench: Workbench, values: Mapping[str, float], rng: np.random.Generator, draws: int = DRAWS
) -> FloatArray:
    """Return comparable residuals of the present model under random nuisance, shape (N, draws)."""
    speeds = [[gaussian_filter1d(v, 0.004 / run.sample_time) for v in run.measured] for run in bench.runs]
    forces = [
        partial(nuisance, bench, values, speeds, seed) for seed in (int(s) for s in rng.integers(0, 2**63, draws))
    ]
    return bench.comparable(bench.pushed(values, forces, 1.0))


def chance(bench: Workbench, screened: Sequence[Screened], null: FloatArray, present: FloatArray) -> Chance:
    """Return what every candidate explains of null residuals."""
    e = null - present @ (present.T @ null)
    total = np.maximum(np.sum(e**2, axis=0), 1e-300)

    entries = list(bench.pool.map(lambda s: s.explains(bench, e) / total, screened))
    names = tuple(dict.fromkeys(s.candidate.name for s in screened))
    gains = np.column_stack(
        [np.max([g for g, s in zip(entries, screened, strict=True) if s.candidate.name == n], axis=0) for n in names]
    )
    # a candidate that chance hardly feeds must still explain something
    return Chance(names, gains, np.maximum(np.quantile(gains, 0.97, axis=0), 4e-3))


def nuisance(
    bench: Workbench, values: Mapping[str, float], speeds: Sequence[Sequence[FloatArray]], seed: int
) -> list[FloatArray]:
    """Return one draw of nuisance forces, for every recording ndarray, shape (2, n) [V]; ``speeds`` are smoothed velocities."""
    rng = np.random.default_rng(seed)
    # what differs from run to run was estimated from these very recordings; the rest varies over what rigs show
    between = bench.spread.get("friction", 0.05) * _log_uniform(rng, *_ABOUT)
    within, rough = (_log_uniform(rng, *limits) for limits in (_WITHIN, _ROUGH))
    length, noise = _log_uniform(rng, *_LENGTH_MM), _log_uniform(rng, *_NOISE_V)
    carts = len(bench.runs[0].keep)
    profiles = [_Profile(rng, length) for _ in range(carts)]
    # half of it: friction along the track makes constant forces too
    slope = 0.5 * bench.spread.get("offset", 0.005) * _log_uniform(rng, *_ABOUT)
    slopes = [_Profile(rng, _log_uniform(rng, *_SLOPE_MM)) for _ in range(carts)]
    pushes = []
    start = rng.uniform(-_START_MM, _START_MM) if bench.parts else 0.0
    # what all parts of one recording share is no difference between them: a friction or a slope that chance could make there
    # would be a property of the drive
    ways = [np.concatenate([r.track[c] for r in bench.runs]) + start for c in range(carts)]
    shared = [float(np.mean(profile(way))) if bench.parts else 0.0 for profile, way in zip(slopes, ways, strict=True)]
    for run, speed in zip(bench.runs, speeds, strict=True):
        n, h = len(run.u), run.sample_time
        force = np.zeros((2, n))
        if not bench.parts:
            start = rng.uniform(-_START_MM, _START_MM)
        for c in range(carts):
            v = speed[c]
            level = max(values.get(f"d{c + 1}", 0.0) + _bristles(values, c), 0.05)
            keep = np.exp(-_COARSE * h / _WANDER_S)
            slow = lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], rng.standard_normal(n // _COARSE + 2))
            wander = np.interp(np.arange(n) / _COARSE, np.arange(n // _COARSE + 2), slow)
            own = 0.0 if bench.parts else between * rng.standard_normal()
            friction = own + within * wander + rough * profiles[c](run.track[c] + start)
            coarse = max(1, round(0.5 / _BAND_HZ / h))
            shake = np.interp(np.arange(n) / coarse, np.arange(n // coarse + 2), rng.standard_normal(n // coarse + 2))
            force[c] = noise * shake
            force[c] += slope * (slopes[c](run.track[c] + start) - shared[c])
            force[c] -= np.where(np.abs(v) > _RESTING, np.sign(v), 0.0) * level * friction
        pushes.append(force)
    return pushes


def _bristles(values: Mapping[str, float], cart: int) -> float:
    return values.get(f"presliding.cart_{cart + 1}.fd", 0.0)


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


class _Profile:
    """A random stationary function of position with unit variance: a sum of waves of random length."""

    def __init__(self, rng: np.random.Generator, length: float, waves: int = 40) -> None:
        self.k = rng.standard_normal(waves) / length
        self.phase = rng.uniform(0.0, 2.0 * np.pi, waves)

    def __call__(self, x: FloatArray) -> FloatArray:
        grid = np.linspace(float(x.min()) - 1.0, float(x.max()) + 1.0, 400)
        values = np.sqrt(2.0 / len(self.k)) * np.cos(self.k[:, None] * grid + self.phase[:, None]).sum(axis=0)
        return np.asarray(np.interp(x, grid, values))

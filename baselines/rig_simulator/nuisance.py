"""What differs from run to run and from place to place on a real rig, and is nobody's left-out physics.

The levels are those of two recorded rigs (``python -m benchmarks blind_nuisance``): what does not repeat is 2.9 mm/s on the
quieter one, 7.5 mm/s on the other, encoder counts included, where the counts alone make about 2.1 mm/s; dry friction differs
by some 7 % (one standard deviation) between runs of one amplitude, more where the rig warmed up.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from baselines.rig_simulator.kernel import (
    FORCE_1,
    FORCE_2,
    FRICTION_1,
    FRICTION_2,
    GAIN,
    HILL_1,
    HILL_2,
    ROUGH_1,
    ROUGH_2,
    SAMPLE_S,
    TRACK_POINTS,
    TRACK_STEP_MM,
    VISCOUS_1,
    VISCOUS_2,
    FloatArray,
)
from baselines.rig_simulator.rig import Disturbances

NOISE_BAND_HZ = 50.0


@dataclass(frozen=True)
class Nuisance:
    """Levels of the nuisance of one data set; standard deviations.

    Attributes
    ----------
    between_runs
        Of the friction's factor from run to run [-].
    within_run
        Of its slow wandering within a run [-], and ``memory`` of that wandering [s].
    rough
        Of the dry friction along the track relative to its level [-].
    hills
        Of the force along the track [V].
    grain
        Correlation length of both along the track [mm].
    noise
        Of the force noise up to 50 Hz on cart 1 [V]; cart 2 has half of it.
    place
        Of the start on the track [mm].
    """

    between_runs: float = 0.0
    within_run: float = 0.0
    memory: float = 1.0
    rough: float = 0.0
    hills: float = 0.0
    grain: float = 5.0
    noise: float = 0.0
    place: float = 0.0


def draw_nuisance(rng: np.random.Generator) -> Nuisance:
    """Draw the levels of a data set: most as quiet as the quieter of the two recorded rigs, some about twice as rough."""
    level = float(np.clip(np.exp(rng.normal(0.25, 0.25)), 0.8, 2.0))
    return Nuisance(
        between_runs=0.06 * level * float(rng.uniform(0.7, 1.3)),
        within_run=0.04 * level * float(rng.uniform(0.6, 1.4)),
        memory=float(rng.uniform(0.3, 2.0)),
        rough=0.07 * level * float(rng.uniform(0.6, 1.4)),
        hills=0.014 * level * float(rng.uniform(0.6, 1.4)),
        grain=float(rng.uniform(2.0, 8.0)),
        noise=0.04 * level * float(rng.uniform(0.7, 1.3)),
        place=25.0,
    )


def profile(rng: np.random.Generator, grain: float) -> FloatArray:
    """Return a stationary random profile of unit variance along the track.

    Parameters
    ----------
    rng
        Source of randomness.
    grain
        Correlation length [mm]; the correlation is Gaussian.

    Returns
    -------
    ndarray, shape (TRACK_POINTS,)
    """
    # white noise shaped in the spatial spectrum; the track is far longer than any grain, so that its ends may meet
    q = np.fft.rfftfreq(TRACK_POINTS, TRACK_STEP_MM)
    shape = np.exp(-((np.pi * q * grain) ** 2) / 2.0)
    z = rng.standard_normal(len(q)) + 1j * rng.standard_normal(len(q))
    rough = np.fft.irfft(z * shape, TRACK_POINTS)
    return np.asarray((rough - rough.mean()) / rough.std())


def band_noise(rng: np.random.Generator, n: int, band: float = NOISE_BAND_HZ) -> FloatArray:
    """Return noise of unit variance between 0 and ``band`` [Hz], shape (n,), at the sample rate."""
    f = np.fft.rfftfreq(2 * n, SAMPLE_S)
    z = (rng.standard_normal(len(f)) + 1j * rng.standard_normal(len(f))) * (f <= band) * (f > 0.0)
    noise = np.fft.irfft(z, 2 * n)
    return np.asarray((noise / noise.std())[:n])


def wander(rng: np.random.Generator, n: int, memory: float) -> FloatArray:
    """Return a slow random walk that forgets within ``memory`` [s], unit variance, shape (n,)."""
    # twice a first-order lag, so that the path is smooth; one step is 50 samples and straight in between
    step = 50
    m = n // step + 2
    keep = float(np.exp(-step * SAMPLE_S / memory))
    a, b = float(rng.standard_normal()), float(rng.standard_normal())
    path = np.empty(m)
    for i in range(m):
        a = keep * a + np.sqrt(1.0 - keep**2) * float(rng.standard_normal())
        b += (1.0 - keep) * (a - b) * 2.0
        path[i] = b
    return np.asarray(np.interp(np.arange(n), step * np.arange(m), path))


def track_of(nuisance: Nuisance, rng: np.random.Generator) -> FloatArray:
    """Return the track of a data set, ndarray, shape (4, TRACK_POINTS): it is the same in every run."""
    track = np.empty((4, TRACK_POINTS))
    for row, scale in ((ROUGH_1, nuisance.rough), (ROUGH_2, nuisance.rough), (HILL_1, nuisance.hills)):
        track[row] = scale * profile(rng, nuisance.grain)
    track[HILL_2] = 0.5 * nuisance.hills * profile(rng, nuisance.grain)
    return track


def nuisance_of_run(
    nuisance: Nuisance, track: FloatArray, n: int, band: float, rng: np.random.Generator
) -> Disturbances:
    """Draw the nuisance of one run.

    Parameters
    ----------
    nuisance
        The data set's levels.
    track : ndarray, shape (4, TRACK_POINTS)
        The data set's track.
    n
        Samples of the run.
    band
        Friction band of the spring's rest position, abs(δ) [mm].
    rng
        Source of randomness.
    """
    table = np.ones((7, n + 1))
    for dry, viscous in ((FRICTION_1, VISCOUS_1), (FRICTION_2, VISCOUS_2)):
        between = float(np.exp(nuisance.between_runs * rng.standard_normal()))
        table[dry] = between * np.exp(nuisance.within_run * wander(rng, n + 1, nuisance.memory))
        table[viscous] = float(np.exp(0.4 * nuisance.between_runs * rng.standard_normal()))
    table[FORCE_1] = nuisance.noise * band_noise(rng, n + 1)
    table[FORCE_2] = 0.5 * nuisance.noise * band_noise(rng, n + 1)
    table[GAIN] = 1.0
    place = nuisance.place * float(rng.standard_normal())
    deflection = float(rng.uniform(-0.7, 0.7)) * band
    phases = (float(rng.random()), float(rng.random()))
    return Disturbances(table, track, place, deflection if nuisance.place > 0.0 else 0.0, phases)

"""How well a controller carried the second cart along a reference: one run in numbers.

All are taken from the carts' true states where these are known (simulation), because that is what the laboratory wants moved;
an encoder may say otherwise. A *dwell* is a stretch of at least 0.15 s in which the reference rests after a move.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from math import inf, nan

import numpy as np

from flexdrive_gym import Drive, Recording
from flexdrive_gym.recording import FloatArray
from flexdrive_gym.units import measured_in

TOLERANCE_MM = 2.0
TRAVEL_MM = 250.0
_SHORTEST_DWELL_S = 0.15
_GROWTH = 1.4
_SWING_MM = 25.0
_REST_MM = 1e-9


@dataclass(frozen=True)
class Measures:
    """One run in numbers.

    Attributes
    ----------
    rms, peak
        Of xr - x2 [mm].
    settling
        Longest time after a move until x2 stays within the tolerance [s]; inf where it never does before the next move.
    overshoot
        Largest excursion beyond the target, in the move's direction, over the move's length [%].
    vibration
        Mean energy of the vibration in the second half of the dwells, kinetic and of the spring about its rest [V mm].
    effort, effort_peak
        rms and peak of the command [V].
    limited
        Share of samples with the command at its limit [].
    stable
        Within the travel, and not growing (below).
    success
        Stable, and settled within the tolerance in every dwell.
    """

    rms: float = field(metadata=measured_in("mm"))
    peak: float = field(metadata=measured_in("mm"))
    settling: float = field(metadata=measured_in("s"))
    overshoot: float
    vibration: float = field(metadata=measured_in("V mm"))
    effort: float = field(metadata=measured_in("V"))
    effort_peak: float = field(metadata=measured_in("V"))
    limited: float
    stable: bool
    success: bool


NAMES = tuple(f.name for f in fields(Measures))


@dataclass(frozen=True)
class Dwell:
    """Where the reference rests: samples ``begin`` … ``end - 1``, and the move before it [mm]."""

    begin: int
    end: int
    move: float

    @property
    def middle(self) -> int:
        """First sample of the second half, where the arrival is over."""
        return (self.begin + self.end) // 2


def dwells(xr: FloatArray, sample_time: float) -> tuple[Dwell, ...]:
    """Return the rests of a reference that follow a move."""
    still = np.abs(np.diff(xr)) < _REST_MM
    edges = np.flatnonzero(np.diff(np.concatenate([[0], still.astype(int), [0]])))
    found, last = [], float(xr[0])
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        move = float(xr[begin]) - last
        last = float(xr[begin])
        if move != 0.0 and (end - begin) * sample_time >= _SHORTEST_DWELL_S:
            found.append(Dwell(int(begin), int(end) + 1, move))
    return tuple(found)


def growing(error: FloatArray) -> bool:
    """Whether a run's response amplitude increases, as in :func:`baselines.loop_analysis.stability_limit.grows`."""
    half = len(error) // 2
    first, second = float(np.ptp(error[:half])), float(np.ptp(error[half:]))
    return second > _SWING_MM and second > _GROWTH * first


def measure(
    drive: Drive, xr: FloatArray, states: FloatArray, u: FloatArray, sample_time: float, *, limit: float = inf,
    tolerance: float = TOLERANCE_MM, travel: float = TRAVEL_MM,
) -> Measures:  # fmt: skip
    """Return the measures of one run.

    Parameters
    ----------
    drive
        For the energies of its masses and spring.
    xr : ndarray, shape (n,)
        Reference as the task states it, before any shaping [mm].
    states : ndarray, shape (4, n)
        x1, v1, x2, v2 [mm], [mm/s].
    u : ndarray, shape (n,)
        Command [V].
    limit
        Of the command [V].
    tolerance
        For settling [mm].
    travel
        Largest |x| of a cart [mm].

    Returns
    -------
    Measures
        With nan or inf where the run left what numbers can say; never an exception.
    """
    x1, v1, x2, v2 = states
    if not np.isfinite(states).all() or not np.isfinite(u).all():
        return Measures(inf, inf, inf, nan, inf, inf, inf, 1.0, stable=False, success=False)
    e = xr - (x2 if drive.carts == 2 else x1)
    stable = float(np.max(np.abs(states[[0, 2]]))) <= travel and not growing(e)
    rests = dwells(xr, sample_time)
    settling, overshoot, energies = 0.0, 0.0, []
    for rest in rests:
        inside = e[rest.begin : rest.end]
        late = np.flatnonzero(np.abs(inside) > tolerance)
        after = 0 if not len(late) else int(late[-1]) + 1
        settling = max(settling, inf if after >= len(inside) else after * sample_time)
        overshoot = max(overshoot, 100.0 * float(np.max(-inside * np.sign(rest.move))) / abs(rest.move))
        half = slice(rest.middle, rest.end)
        energies.append(_vibration(drive, x1[half], v1[half], x2[half], v2[half]))
    touches = np.abs(u) > 0.999 * limit
    return Measures(
        rms=float(np.sqrt(np.mean(e**2))),
        peak=float(np.max(np.abs(e))),
        settling=settling if rests else nan,
        overshoot=overshoot if rests else nan,
        vibration=_negligible(float(np.mean(energies))) if energies else nan,
        effort=float(np.sqrt(np.mean(u**2))),
        effort_peak=float(np.max(np.abs(u))),
        limited=float(np.mean(touches)),
        stable=stable,
        success=stable and bool(np.isfinite(settling)),
    )


def _negligible(energy: float) -> float:
    """Return 0 for an energy below that of 1 µm on a spring of 0.1 V/mm, which is round-off."""
    return energy if energy > 5e-8 else 0.0


def _vibration(drive: Drive, x1: FloatArray, v1: FloatArray, x2: FloatArray, v2: FloatArray) -> float:
    """Return the mean energy ½m1·v1² + ½m2·v2² + ½k·(δ - mean δ)²; a deflection that friction holds is no vibration."""
    if drive.carts == 1:
        return float(np.mean(0.5 * drive["m1"] * v1**2))
    delta = x1 - x2
    energy = 0.5 * (drive["m1"] * v1**2 + drive["m2"] * v2**2 + drive["k"] * (delta - delta.mean()) ** 2)
    return float(np.mean(energy))


def measure_recording(drive: Drive, run: Recording, *, limit: float = inf, tolerance: float = TOLERANCE_MM) -> Measures:
    """Return the measures of a recorded run by what its encoders say; velocities are differences where not recorded.

    Raises
    ------
    ValueError
        If the run has no reference or lacks a position.
    """
    if run.xr is None or run.x1 is None or (drive.carts == 2 and run.x2 is None):
        raise ValueError(f"{run.name}: needs xr and the positions; record them.")
    x2 = run.x1 if run.x2 is None else run.x2
    v1, v2 = (np.gradient(x, run.sample_time) for x in (run.x1, x2))
    states = np.array([run.x1, v1, x2, v2])
    return measure(drive, run.xr, states, run.u, run.sample_time, limit=limit, tolerance=tolerance)

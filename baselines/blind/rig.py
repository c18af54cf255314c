"""An independent simulation of the rig: one run, from a command and surroundings to encoder counts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from baselines.blind.kernel import FORCE_1, FORCE_2, STEPS, TRACK_POINTS, FloatArray, advance_run, vector


@dataclass(frozen=True, eq=False)
class Motion:
    """What one run did, sampled at 1 kHz.

    Attributes
    ----------
    u : ndarray, shape (n,)
        Command [V].
    counts : ndarray, shape (2, n)
        Encoder counts.
    states : ndarray, shape (4, n)
        True x1 [mm], v1 [mm/s], x2, v2, before any encoder.
    shown : ndarray, shape (2, n)
        What the encoders' discs show before counting [mm].
    """

    u: FloatArray
    counts: FloatArray
    states: FloatArray
    shown: FloatArray


@dataclass(frozen=True, eq=False)
class Surroundings:
    """Everything about a run that is not the drive: where and how it starts, and the tables.

    Attributes
    ----------
    over_time : ndarray, shape (7, n + 1)
        Factors of d1, d2, b1, b2; forces on cart 1 and 2 [V]; gain.
    track : ndarray, shape (4, TRACK_POINTS)
        Friction of cart 1, 2 relative to the level; force on cart 1, 2 [V]; from -1000 mm to 1000 mm.
    place
        Start of cart 1 on the track [mm].
    deflection
        Spring at the start, δ [mm].
    phases
        Of the encoders within a count, 0…1.
    """

    over_time: FloatArray
    track: FloatArray
    place: float = 0.0
    deflection: float = 0.0
    phases: tuple[float, float] = (0.0, 0.0)


def quiet(n: int) -> Surroundings:
    """Return surroundings without any nuisance, for n samples."""
    table = np.ones((7, n + 1))
    table[[FORCE_1, FORCE_2]] = 0.0
    return Surroundings(table, np.zeros((4, TRACK_POINTS)))


def run(
    values: Mapping[str, float],
    surroundings: Surroundings,
    command: FloatArray,
    *,
    gain: float = 0.0,
    feedback: int = 2,
    steps: int = STEPS,
) -> Motion:
    """Run the rig.

    Parameters
    ----------
    values
        Numbers named in :mod:`baselines.blind.kernel`; m1, m2, b1, b2, k, d1, d2 at least.
    surroundings
        Start and tables.
    command : ndarray, shape (n,)
        u [V], or the reference xr [mm] if ``gain`` is positive.
    gain
        Kp [V/mm] of P-control; 0 is open loop.
    feedback
        The encoder it reads, 1 or 2.
    steps
        Fine steps per sample.
    """
    n = len(command)
    u, counts, states, shown = np.zeros(n), np.zeros((2, n)), np.zeros((4, n)), np.zeros((2, n))
    s = surroundings
    start = np.array([s.place, s.place - s.deflection, s.phases[0], s.phases[1]])
    command = np.ascontiguousarray(command, dtype=np.float64)
    advance_run(vector(values), s.over_time, s.track, start, command, gain, feedback, steps, u, counts, states, shown)
    return Motion(u, counts, states, shown)

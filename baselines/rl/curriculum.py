"""What an agent meets in training: references of every kind and size, and drives around the identified one.

The handout's trajectory is one move out of a continuum here, so that an agent cannot learn it by heart. References that tell
how well an agent does come from the same law and other seeds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from flexdrive_gym import Covariance, Drive
from flexdrive_gym.recording import FloatArray
from flexdrive_gym.references import random_moves, s_curve, sine

# what a rig of 8 V and a travel of 250 mm can follow at all
STROKE_MM = (10.0, 80.0)
SPEED_MM_S = (40.0, 250.0)
ACCELERATION_MM_S2 = (200.0, 1500.0)
DWELL_S = (0.1, 0.6)
JERK_MM_S3 = (2e3, 2e4)
SINE_MM = (3.0, 40.0)
SINE_HZ = (0.2, 2.5)
STEP_MM = 20.0
# a rig differs from its drive by more than the covariance of a fit says: friction between days, physics that is left out
WIDENED = 3.0
WITHOUT_COVARIANCE = {"m1": 0.1, "m2": 0.1, "b1": 0.1, "b2": 0.1, "d1": 0.3, "d2": 0.3, "k": 0.1}
SHARES = {"moves": 0.5, "s_curves": 0.2, "sines": 0.2, "steps": 0.1}


def around(rig: Drive) -> dict[str, Any]:
    """Return arguments of :class:`~flexdrive_gym.task.Task`: a drive, and how training draws others around it.

    With a covariance it is drawn jointly normal, :data:`WIDENED` times as wide; without one, each parameter is uniform within
    :data:`WITHOUT_COVARIANCE` of its value.
    """
    if rig.covariance is not None:
        wide = Covariance(rig.covariance.names, WIDENED**2 * rig.covariance.matrix)
        return {"drive": replace(rig, covariance=wide), "randomise": "identified"}
    ranges = {name: (rig[name] * (1.0 - part), rig[name] * (1.0 + part)) for name, part in WITHOUT_COVARIANCE.items()}
    return {"drive": rig, "randomise": ranges}


def training_reference(t: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return one random reference: moves, S-curves, a sine or steps of random size and speed.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Instants [s], rising from 0.
    rng
        The same state gives the same reference.

    Returns
    -------
    ndarray, shape (n,)
        Position [mm].
    """
    kind = rng.choice(list(SHARES), p=list(SHARES.values()))
    stroke, speed, acceleration = (rng.uniform(*bounds) for bounds in (STROKE_MM, SPEED_MM_S, ACCELERATION_MM_S2))
    dwell = rng.uniform(*DWELL_S)
    if kind == "moves":
        return random_moves(t, rng, stroke, speed, acceleration, dwell)
    if kind == "s_curves":
        jerk = np.exp(rng.uniform(*np.log(JERK_MM_S3)))
        return _legs(t, rng, stroke, dwell, lambda now, leg: s_curve(now, leg, speed, acceleration, jerk))
    if kind == "steps":
        return _legs(t, rng, STEP_MM, dwell + 0.3, np.full_like)
    frequency = rng.uniform(*SINE_HZ)
    # no faster than the moves
    largest = min(SINE_MM[1], speed / (2.0 * np.pi * frequency), acceleration / (2.0 * np.pi * frequency) ** 2)
    return sine(t, rng.uniform(min(SINE_MM[0], largest), largest), frequency)


def evaluation_reference(t: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return a reference of the same law that training never meets."""
    return training_reference(t, np.random.default_rng((1, int(rng.integers(2**62)))))


def _legs(
    t: FloatArray,
    rng: np.random.Generator,
    stroke: float,
    dwell: float,
    move: Callable[[FloatArray, float], FloatArray],
) -> FloatArray:
    """Return moves to random targets within ``stroke``, each begun a dwell after the one before has come to rest."""
    values, begin, position = np.zeros_like(t), 0.0, 0.0
    while begin <= t[-1]:
        target = rng.uniform(-stroke, stroke)
        later = t >= begin
        course = move(t[later] - begin, target - position)
        values[later] = position + course
        moving = np.flatnonzero(np.abs(course - (target - position)) > 1e-6)
        begin += dwell + (float(t[later][moving[-1]]) - begin if len(moving) else 0.0)
        position = target
    return values

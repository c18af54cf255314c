"""Dry friction of a drive along a measured motion: what differs from run to run is a share of it."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter1d

from flexdrive_gym.drive.compilation import kernel, pointer
from flexdrive_gym.drive.effects import WORKSPACE
from flexdrive_gym.drive.forces import level_1, level_2, row, spring_force
from flexdrive_gym.drive.sample import WORK_SPACE, anchor, clear
from flexdrive_gym.recording import FloatArray
from identification.mismatch.fitting.bench import Values
from identification.replay.output_error import Run, drive_vector

# of velocities
_SMOOTH_S = 0.004
# of the rms speed: slower than this a cart may rest
_RESTING = 0.05


@kernel
def _levels(h: float, states: Any, memory: Any, z: Any, p: Any, out: Any) -> None:
    q, m, w = pointer(p), pointer(memory), pointer(z)
    clear(states[1, 0], states[3, 0], m, w, q)
    for i in range(states.shape[1]):
        x1, v1, x2, v2 = states[0, i], states[1, i], states[2, i], states[3, i]
        anchor(x1, x2, x1, x2, w)
        fs = spring_force(x1 - x2, v1 - v2, w, row(0), q)
        out[0, i] = level_1(x1, v1, np.sign(v1), fs, i * h, w, w, row(0), q)
        out[1, i] = level_2(x2, v2, np.sign(v2), fs, i * h, w, w, row(0), q)


def level_along(values: Values, run: Run, c: int) -> FloatArray:
    """Return the dry friction of a cart along the measured motion of a run, shape (n,) [V].

    A load, a place, a speed or a direction may change it.
    """
    v = np.array([speed(y, run.sample_time, positions=run.positions) for y in run.measured])
    states, out = np.zeros((4, v.shape[1])), np.zeros((2, v.shape[1]))
    states[0 : 2 * len(v) : 2], states[1 : 2 * len(v) : 2] = run.track[: len(v)], v
    p, memory, z = drive_vector(values, run), np.zeros(WORK_SPACE), np.zeros(WORKSPACE)
    _levels(run.sample_time, states, memory, z, p, out)
    return np.asarray(out[c] + _bristles(values, c))


def dry_level(values: Values, c: int) -> float:
    """Return a cart's dry friction while it moves [V]."""
    return values.get(f"d{c + 1}", 0.0) + _bristles(values, c)


def _bristles(values: Values, c: int) -> float:
    return values.get(f"presliding.cart_{c + 1}.fd", 0.0)


def speed(y: FloatArray, h: float, *, positions: bool) -> FloatArray:
    """Return a cart's smoothed velocity from its velocity or position."""
    v = gaussian_filter1d(y, _SMOOTH_S / h)
    return np.gradient(v, h) if positions else v


def moving(y: FloatArray, h: float, *, positions: bool) -> FloatArray:
    """Return the direction in which a cart moves, 0 where it may rest, from its velocity or position."""
    v = speed(y, h, positions=positions)
    limit = _RESTING * float(np.sqrt(np.mean(v**2)))
    return np.asarray(np.where(np.abs(v) > limit, np.sign(v), 0.0))

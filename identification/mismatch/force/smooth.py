r"""Motion without a model: the weak form of the equations of motion, and what the catalogue's effects do along it.

Multiplied by a test function :math:`\varphi(t) = (1 - s^2)^4`, :math:`s = 2(t - t_k)/T`, and integrated by parts, a signal's
derivatives are those of the test function,

.. math:: a_k = \int \ddot\varphi\, x\, dt, \qquad v_k = -\int \dot\varphi\, x\, dt, \qquad \int \varphi\, dt = 1,

so encoder counts are never differentiated (D. A. Messenger, D. M. Bortz, Weak SINDy, Multiscale Model. Simul. 19, 2021). Only
what enters non-linearly is smoothed. A held command acts as (u[n] + u[n-1])/2.

What an effect does is not written again here. The drive's own compiled step is led along the measured motion: at every sample it
starts from the measured state, keeping only what effects remember, and the change of its acceleration by an effect, times the
mass, is the effect's force.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter1d

from flexdrive_gym.drive.compilation import kernel, pointer, shifted
from flexdrive_gym.drive.effects import EFFECTS, WORKSPACE
from flexdrive_gym.drive.parameters import substeps
from flexdrive_gym.drive.piece import tabulate
from flexdrive_gym.drive.sample import MEMORY, WORK_SPACE, advance, anchor, clear
from flexdrive_gym.drive.step import step
from flexdrive_gym.recording import BoolArray, FloatArray, Recording
from identification.mismatch.settings import Settings
from identification.replay.output_error import Run, drive_vector, prepare
from identification.signals import motions

# a force beyond this is that of a step too long for its effect [V]
_LARGEST = 1e6


@dataclass(frozen=True, eq=False)
class Motion:
    """One recording in the weak form.

    Attributes
    ----------
    recording, run
        What was recorded, and prepared for simulation.
    x, v : ndarray, shape (carts, n)
        Positions [mm], as recorded or summed, and smoothed velocities [mm/s].
    u : ndarray, shape (n,)
        Command as it acts in the middle of a sample's neighbourhood [V].
    acceleration, velocity, deflection, command
        Weak acceleration and velocity, shape (carts, K); deflection and command, shape (K,).
    segment : ndarray, shape (K,)
        Number of the segment since the last fault: each has an unknown offset of the deflection.
    sliding : ndarray of bool, shape (carts, K)
        Whether the cart keeps its direction, well away from rest, throughout a test function.
    kernels : tuple of ndarray, shape (L,)
        Test function and its derivatives, as weights of samples.
    windows : ndarray, shape (K,)
        First sample of each test function.
    """

    recording: Recording
    run: Run
    x: FloatArray
    v: FloatArray
    u: FloatArray
    acceleration: FloatArray
    velocity: FloatArray
    deflection: FloatArray
    command: FloatArray
    segment: FloatArray
    sliding: BoolArray
    kernels: tuple[FloatArray, FloatArray, FloatArray]
    windows: npt.NDArray[np.int64]

    def weak(self, f: FloatArray) -> FloatArray:
        """Return the mean of a signal of shape (..., n) under each test function, shape (..., K)."""
        return _under(f, self.kernels[0], self.windows)

    def direction(self) -> FloatArray:
        """Return the mean direction of motion under each test function, shape (carts, K)."""
        return self.weak(np.sign(self.v))


def motion(recording: Recording, settings: Settings, window_s: float) -> Motion:
    """Return the weak form of one recording with test functions of a length [s]."""
    run = prepare(recording)
    h, carts = recording.sample_time, len(run.measured)
    valid = [k for _, k in zip(run.measured, motions(recording)[1], strict=True)]
    x = np.array(run.track[:carts])
    width = settings.smoothing_s / h
    v = np.array([gaussian_filter1d(np.gradient(gaussian_filter1d(row, width), h), 0.5 * width) for row in x])
    good = np.all(valid, axis=0)
    segment = np.concatenate([[0], np.cumsum(good[1:] & ~good[:-1])])
    u = recording.u if recording.hold == "band_limited" else 0.5 * (recording.u + np.roll(recording.u, 1))
    u[0] = recording.u[0]
    kernels = _test_functions(max(8, round(window_s / h)), h)
    length = len(kernels[0])
    first = np.arange(0, max(recording.n - length, 1), max(1, round(settings.hop_s / h)))
    span = np.lib.stride_tricks.sliding_window_view
    whole = span(good, length)[first].all(axis=1) if recording.n > length else np.zeros(len(first), dtype=bool)
    first = first[whole].astype(np.int64)
    slow = settings.reversal * np.sqrt(np.mean(v**2, axis=1))
    sliding = np.array([_keeps(span(row, length)[first], limit) for row, limit in zip(v, slow, strict=True)])
    return Motion(
        recording,
        run,
        x,
        v,
        u,
        _under(x, kernels[2], first),
        -_under(x, kernels[1], first),
        _under(x[0] - x[1], kernels[0], first) if carts == 2 else np.zeros(len(first)),
        _under(u, kernels[0], first),
        segment[first + length // 2],
        sliding,
        kernels,
        first,
    )


def _keeps(v: FloatArray, limit: float) -> BoolArray:
    return np.asarray((v > limit).all(axis=1) | (v < -limit).all(axis=1))


def _test_functions(length: int, h: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    s = (2.0 * (np.arange(length) + 0.5) / length) - 1.0
    rate = 2.0 / (length * h)
    inside = 1.0 - s**2
    phi = inside**4
    first = -8.0 * s * inside**3 * rate
    second = (-8.0 * inside**3 + 48.0 * s**2 * inside**2) * rate**2
    total = float(phi.sum())
    # exact for a parabola on the sampled points: the second derivative of t²/2 is one
    t = s / rate
    second = second - second.mean()
    second /= float(second @ (0.5 * t**2))
    first /= -float(first @ t)
    return phi / total, first, second


def _under(f: FloatArray, kernel_: FloatArray, first: npt.NDArray[np.int64]) -> FloatArray:
    views = np.lib.stride_tricks.sliding_window_view(f, len(kernel_), axis=-1)[..., first, :]
    return np.asarray(views @ kernel_)


@kernel
def _led(u: Any, h: float, steps: int, states: Any, memory: Any, z: Any, p: Any, out: Any) -> None:
    """Write the mean acceleration over every sample of a drive that is put back on the measured motion before each."""
    q, m, w = pointer(p), pointer(memory), pointer(z)
    table = shifted(m, MEMORY)
    tabulate(h / steps, table, q)
    clear(states[1, 0], states[3, 0], m, w, q)
    for i in range(u.shape[0]):
        x1, v1, x2, v2 = states[0, i], states[1, i], states[2, i], states[3, i]
        anchor(x1, x2, x1, x2, w)
        _x1, w1, _x2, w2 = advance(step, x1, v1, x2, v2, u[i], i * h, h, steps, table, m, w, q)
        out[0, i], out[1, i] = (w1 - v1) / h, (w2 - v2) / h


def led(values: Mapping[str, float], motion_: Motion, every: int = 1) -> FloatArray:
    """Return the mean acceleration of a drive along a measured motion, over so many samples each, shape (2, steps) [mm/s²]."""
    n = len(motion_.u) // every
    h = motion_.recording.sample_time * every
    states = np.zeros((4, n))
    carts = len(motion_.x)
    states[0 : 2 * carts : 2] = motion_.x[:, : n * every : every]
    states[1 : 2 * carts : 2] = motion_.v[:, : n * every : every]
    u = np.ascontiguousarray(motion_.recording.u[: n * every].reshape(n, every).mean(axis=1))
    out = np.empty((2, n))
    p = drive_vector(values, motion_.run)
    # a step as long as a sample of the motion: nothing is carried over to the next but what effects remember
    _led(u, h, substeps(values, h, h), states, np.zeros(WORK_SPACE), np.zeros(WORKSPACE), p, out)
    return out


def force_of(
    values: Mapping[str, float],
    effect: Mapping[str, float],
    motion_: Motion,
    every: int,
    bare: FloatArray | None = None,
) -> FloatArray:
    """Return the force of an effect on each cart along a measured motion, weak, shape (2, K) [V].

    Parameters
    ----------
    values
        Drive without the effect. Without dry friction no cart sticks, and the force of what acts at rest shows.
    effect
        Its parameters.
    every
        Samples per step along the motion.
    bare : ndarray, shape (2, steps), or None
        Acceleration without the effect, where it is known.
    """
    change = led({**values, **effect}, motion_, every) - (led(values, motion_, every) if bare is None else bare)
    masses = np.array([values["m1"], min(values.get("m2", 1.0), 1e6)])
    force = np.zeros((2, len(motion_.u)))
    # along a motion that it does not make an effect may be as large as numbers are, and is clipped
    with np.errstate(over="ignore"):
        fine = np.repeat(np.nan_to_num(change) * masses[:, None], every, axis=1)
    force[:, : fine.shape[1]] = np.clip(fine, -_LARGEST, _LARGEST)
    # what acts over a step is felt in the middle of it
    force[:, 1:] = 0.5 * (force[:, 1:] + force[:, :-1])
    return motion_.weak(force)


FRICTION_EFFECTS = frozenset(e.id for e in EFFECTS if any(hook.startswith("friction") for hook in e.hooks))

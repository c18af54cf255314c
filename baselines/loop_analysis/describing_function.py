r"""What a controller does to a sine: its equivalent gain and phase over frequency, at several amplitudes.

A sine :math:`e = A \sin \omega t` of tracking error is fed to the controller at the rig's sample time, through encoders that
count, with the reference at rest. The command's component at the same frequency, over the sine, is the sinusoidal-input
describing function

.. math:: N(A, \omega) = \frac{2}{A T} \int_0^T u(t)\, \left(\sin \omega t + j \cos \omega t\right) dt ,

(A. Gelb, W. E. Vander Velde, Multiple-Input Describing Functions and Nonlinear System Design, 1968, ch. 3). It is the frequency
response of a linear controller, and depends on the amplitude for any other, so that a learnt policy can be drawn beside Lab 4.
With the drive's linear response it is an equivalent loop gain; where that passes -180° it predicts the gain margin for
vibrations of that size.

Frequencies are multiples of the window's inverse, so that every sine fits whole.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from itertools import pairwise
from math import inf

import numpy as np
import numpy.typing as npt

from baselines.evaluation.adapters import PolicyBatch, PolicyController
from baselines.evaluation.rollout import RIG_TIME_S, runs_in_batch
from baselines.loop_analysis.loops import ComplexArray, linear_part, response, sampled_drive
from flexdrive_gym import Controller, Drive, LinearController, Observation
from flexdrive_gym.drive.default import HANDOUT_QUANTUM_MM
from flexdrive_gym.recording import FloatArray
from flexdrive_gym.units import measured_in

AMPLITUDES_MM = (0.5, 2.0, 8.0)
WINDOW_S = 4.0
SETTLING_S = 4.0
# denser where the spring resonates
FREQUENCIES_HZ = (
    0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0, 2.25, 2.5, 2.75, 3.0, 3.25, 3.5, 4.0, 4.5, 5.0, 6.0, 7.0, 8.0, 10.0, 12.0, 16.0,
    20.0,
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Sweep:
    """Describing functions of one controller.

    Attributes
    ----------
    frequencies : ndarray, shape (m,)
        [Hz]
    amplitudes : ndarray, shape (a,)
        Of the tracking error [mm].
    response : ndarray of complex, shape (a, m)
        Command over tracking error [V/mm].
    reads
        ``x1`` or ``x2``, which encoder the sine was put on; with both, both move alike.
    """

    frequencies: FloatArray = field(metadata=measured_in("Hz"))
    amplitudes: FloatArray = field(metadata=measured_in("mm"))
    response: ComplexArray = field(metadata=measured_in("V/mm"))
    reads: str


def sweep(
    controller: Controller,
    reads: str,
    *,
    frequencies: Sequence[float] = FREQUENCIES_HZ,
    amplitudes: Sequence[float] = AMPLITUDES_MM,
    quantum: float = HANDOUT_QUANTUM_MM,
    sample_time: float = RIG_TIME_S,
) -> Sweep:
    """Sweep a controller.

    Parameters
    ----------
    controller
        Anything with the protocol. A linear one that is slower than the rig holds its command between its samples.
    reads
        Which encoder the sine is put on: ``x1``, ``x2`` or ``x1, x2``; the other one rests.
    frequencies
        [Hz], multiples of 0.25 Hz below half the sample rate.
    amplitudes
        Of the tracking error [mm].
    quantum
        Encoder count [mm]; 0 for none.
    sample_time
        Of the rig [s].

    Raises
    ------
    ValueError
        For a frequency that does not fit the window, or an amplitude that is not positive.
    """
    f, A = np.asarray(frequencies, dtype=np.float64), np.asarray(amplitudes, dtype=np.float64)
    cycles = f * WINDOW_S
    if not (np.abs(cycles - np.round(cycles)) < 1e-9).all() or f.min() <= 0.0 or f.max() >= 0.5 / sample_time:
        raise ValueError(
            f"frequencies: must be multiples of {1.0 / WINDOW_S:g} Hz, above 0 and below {0.5 / sample_time:g} Hz; got "
            f"{', '.join(f'{v:g}' for v in f)}. Round them."
        )
    if not A.min() > 0.0:
        raise ValueError(f"amplitudes: must be positive [mm]; got {A.min():g}.")
    t = np.asarray(np.arange(round((SETTLING_S + WINDOW_S) / sample_time)) * sample_time, dtype=np.float64)
    phase = 2.0 * np.pi * np.tile(f, len(A))[:, None] * t
    size = np.repeat(A, len(f))[:, None]
    # the reference rests at 0, so the reading is the error's negative
    seen = -size * np.sin(phase)
    speed = -size[:, 0] * 2.0 * np.pi * np.tile(f, len(A))
    if quantum > 0.0:
        seen = quantum * np.round(seen / quantum)
    u = _commands(controller, reads, t, seen, speed)
    window = slice(round(SETTLING_S / sample_time), None)
    kernel = np.sin(phase[:, window]) + 1j * np.cos(phase[:, window])
    found = 2.0 * np.mean(u[:, window] * kernel, axis=1) / size[:, 0]
    return Sweep(f, A, found.reshape(len(A), len(f)), reads)


def _commands(controller: Controller, reads: str, t: FloatArray, seen: FloatArray, speed: FloatArray) -> FloatArray:
    """Return what the controller answers to readings, ndarray, shape (jobs, n); ``speed`` is each reading's rate at the start."""
    jobs, n = seen.shape
    on = np.array(["x1" in reads, "x2" in reads], dtype=np.float64)
    u = np.empty((jobs, n))
    own = deepcopy(controller)
    if isinstance(own, PolicyController):
        own = own.following(np.zeros(n))
        if runs_in_batch(own):
            policies = PolicyBatch(own, jobs)
            for i in range(0, n, own.every):
                readings = np.hstack([seen[:, [i]] * on, speed[:, None] * on])
                u[:, i : i + own.every] = policies(0.0, readings)[:, None]
            return u
    # a slower linear controller takes every so many samples
    every = own.every(float(t[1] - t[0])) if isinstance(own, LinearController) else 1
    if every is None:
        raise ValueError(
            "controller: its sample time must be a whole number of the rig's samples. Design it for a multiple."
        )
    for j in range(jobs):
        reset = getattr(own, "reset", None)
        if reset is not None:
            reset()
        for i in range(0, n, every):
            x, v = seen[j, i] * on, speed[j] * on
            u[j, i : i + every] = own(Observation(float(t[i]), 0.0, float(x[0]), float(x[1]), float(v[0]), float(v[1])))
    return u


def analytic_response(controller: LinearController, reads: str, frequencies: npt.ArrayLike) -> ComplexArray:
    """Return a linear controller's command over tracking error, ndarray of complex, shape (m,) [V/mm].

    That is minus its response to the reading; at its own samples, the hold between them left out.
    """
    c = controller
    omega = 2.0 * np.pi * np.asarray(frequencies, dtype=np.float64)
    to_command = response(c.A, c.B, c.C[:1], c.D[:1], omega, c.sample_time)[:, 0]
    return np.asarray(-sum(to_command[:, i] for i, name in ((1, "x1"), (2, "x2")) if name in reads))


def plant_response(
    drive: Drive, reads: str, frequencies: npt.ArrayLike, sample_time: float = RIG_TIME_S
) -> ComplexArray:
    """Return the linear drive's response from command to the encoder that is read, ndarray of complex, shape (m,) [mm/V]."""
    A, B, C = sampled_drive(linear_part(drive), sample_time)
    omega = 2.0 * np.pi * np.asarray(frequencies, dtype=np.float64)
    found = response(A, B, C, np.zeros((len(C), 1)), omega, sample_time)
    return np.asarray(found[:, 0 if reads == "x1" else len(C) - 1, 0])


def predicted_gain_margins(found: Sweep, drive: Drive) -> tuple[float, ...]:
    """Return what the equivalent loop predicts for the gain margin at each amplitude [].

    The smallest factor by which the loop gain may be raised until it passes -1, interpolated between the frequencies; inf where
    its phase never passes -180° with a gain below 1.
    """
    plant = plant_response(drive, found.reads, found.frequencies)
    return tuple(_gain_margin(row * plant) for row in found.response)


def _gain_margin(L: ComplexArray) -> float:
    factors = [inf]
    for a, b in pairwise(L):
        if (a.imag > 0.0) != (b.imag > 0.0):
            share = a.imag / (a.imag - b.imag)
            real = a.real + share * (b.real - a.real)
            if -1.0 < real < 0.0:
                factors.append(-1.0 / real)
    return float(min(factors))

r"""A force of one frequency that the command does not make: a fan, a pump, a mains hum.

It has no name, and a phase in every recording. In the whitened rows of a cart a steady oscillation is a steady
oscillation, so sine and cosine of every frequency come from one
Fourier transform. Their amplitudes are random with one variance, as in
:mod:`identification.mismatch.candidates.phases`. A recording has no say at the frequencies that its own command can make there:
those of the command, of its sign (odd harmonics, as friction makes them) and of its size (even ones).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flexdrive_gym.recording import BoolArray, FloatArray
from identification.mismatch.fitting.bench import Bench, Columns
from identification.mismatch.fitting.score import averaged, leave_one_out_variance

# slower than this a force is friction that wanders; faster than this encoders hardly see it [Hz]
_LOWEST, _HIGHEST = 0.7, 25.0
# points per frequency that a recording resolves
_FINER = 2
# share of the largest power of a command, its sign or its size above which a frequency is its own: squares up to the 31st
_MADE = 1e-3
# data sets whose transforms are held at a time
_CHUNK = 40


@dataclass(frozen=True)
class Line:
    """A narrow-band disturbance.

    Attributes
    ----------
    where
        Cart whose rows show it.
    frequency
        [Hz].
    """

    where: str
    frequency: float

    @property
    def id(self) -> str:
        """What it is called where candidates are listed."""
        return "narrow-band disturbance"

    @property
    def variable(self) -> str:
        """What the force follows."""
        return f"a force of {self.frequency:.2f} Hz that the command does not make"

    @property
    def name(self) -> tuple[str, str]:
        """What it is called by, and where it acts."""
        return self.id, self.where


def lines(bench: Bench, rest: Columns) -> list[tuple[Line, FloatArray]]:
    """Return the best frequency of every cart with its gain per unit, shape (U, data sets).

    Parameters
    ----------
    rest : ndarray, shape (N, data sets)
        Whitened rows that the others' optimum leaves.
    """
    step = max(run.block * run.sample_time for run in bench.runs)
    longest = max(len(run.u) * run.sample_time for run in bench.runs)
    apart = 1.0 / (_FINER * longest)
    frequency = apart * np.arange(np.ceil(_LOWEST / apart), min(_HIGHEST, 0.4 / step) / apart)
    if len(frequency) < 2:
        return []
    silent = [~made(run.u, run.sample_time, frequency) for run in bench.runs]
    found = []
    for c in range(bench.carts):
        parts = [_gains(bench, rest[:, i : i + _CHUNK], c, frequency, silent) for i in range(0, rest.shape[1], _CHUNK)]
        gain = np.concatenate([g for g, _ in parts], axis=1)
        found.append((Line(f"cart_{c + 1}", float(frequency[parts[0][1]])), gain))
    return found


def _gains(
    bench: Bench, rest: Columns, cart: int, frequency: FloatArray, silent: Sequence[BoolArray]
) -> tuple[FloatArray, int]:
    power, count = [], []
    for p in bench.pieces:
        if p.cart == cart:
            run, own = bench.runs[p.recording], silent[p.recording]
            power.append(np.abs(_spectrum(rest[p.rows], run.block * run.sample_time, frequency)) ** 2 * own[:, None])
            count.append(0.5 * max(float(bench.valid[p.rows].sum()), 1.0) * own)
    gain, _ = leave_one_out_variance(np.array(power), np.array(count), bench.units)
    found, best = averaged(gain)
    return found, int(best[0])


def made(command: FloatArray, sample_time: float, frequency: FloatArray) -> BoolArray:
    """Return at which frequencies a command itself, or what friction makes of it, has power."""
    stride = max(1, int(0.4 / (_HIGHEST * sample_time)) // 2)
    u = command[::stride]
    window = np.hanning(len(u))
    found = np.zeros(len(frequency), dtype=np.bool_)
    for part in (u, np.sign(u), np.abs(u)):
        wave = (part - part.mean()) * window
        if np.any(wave):
            own = np.abs(_spectrum(wave[:, None], stride * sample_time, frequency)[:, 0]) ** 2
            found |= own > _MADE * float(np.max(np.abs(np.fft.rfft(wave)) ** 2))
    return found


def _spectrum(rows: Columns, step: float, frequency: FloatArray) -> npt.NDArray[np.complex128]:
    """Return the Fourier transform of columns at evenly spaced frequencies, shape (frequencies, columns)."""
    n = max(len(rows), round(1.0 / (float(frequency[1] - frequency[0]) * step)))
    return np.asarray(np.fft.rfft(rows, n, axis=0)[np.rint(frequency * n * step).astype(np.int64)])

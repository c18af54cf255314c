r"""Lines in the error's spectrum that the command did not make: something else shakes the rig.

Everything a drive does to a periodic command repeats with it, whatever the physics. A force with a rhythm of its own (a fan, the
mains, a neighbour) stands in every recording at the same frequency, with a phase of its own each time. In each recording the
error's periodogram is divided by what a force of all frequencies would make of the drive, whose resonance is no line, and by the
local median of the rest, harmonics of the command left out. If nothing is there, every value is exponential, and the mean over K
recordings and carts is gamma distributed. The probability is corrected for the number of frequencies looked at.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter
from scipy.stats import gamma

from flexdrive_gym import Drive
from flexdrive_gym.drive.linear import Input, Output
from flexdrive_gym.recording import FloatArray
from identification.mismatch.workbench import Workbench

LOWEST_HZ, HIGHEST_HZ = 0.7, 60.0
_MEDIAN_BINS = 41
_LEAST = 1e-6
# of a drive's response, relative to its peak
_FAINTEST = 1e-6


@dataclass(frozen=True)
class Line:
    """A rhythm that is not the command's.

    Attributes
    ----------
    frequency
        [Hz].
    where
        Cart on which it is stronger against its surroundings.
    share
        Share of the squared error within the line.
    probability
        That nothing is there.
    """

    frequency: float
    where: str
    share: float
    probability: float


def strongest_line(
    bench: Workbench, residual: FloatArray, commands: Sequence[float], values: Mapping[str, float]
) -> Line | None:
    """Return the strongest line of the block residuals, or ``None`` if chance would make one like it.

    Parameters
    ----------
    residual
        Block residuals, shape (N,).
    commands
        Frequency of every recording's command [Hz]; 0 where it does not repeat.
    values
        The drive's parameters.
    """
    step = max(run.block * run.sample_time for run in bench.runs)
    longest = max(bench.rows.blocks)
    grid = np.asarray(np.fft.rfftfreq(longest, step), dtype=np.float64)
    use = (grid > LOWEST_HZ) & (grid < min(HIGHEST_HZ, 0.45 / step))
    shaped = _resonance(values, grid)
    total, count = np.zeros((2, len(grid))), np.zeros((2, len(grid)))
    within, everything = np.zeros(len(grid)), 0.0
    for r, run in enumerate(bench.runs):
        for c in range(len(run.keep)):
            e = residual[bench.piece(r, c)]
            if len(e) < longest // 2:
                continue
            window = np.hanning(len(e))
            power = np.abs(np.fft.rfft((e - e.mean()) * window, longest)) ** 2
            level = median_filter(power / shaped[c], _MEDIAN_BINS) * shaped[c] / np.log(2.0)
            free = np.ones(len(grid), dtype=bool)
            if commands[r] > 0.0:
                # a Hann window is two bins wide on either side
                free = np.abs(grid - commands[r] * np.rint(grid / commands[r])) > 2.5 / (longest * step)
            ratio = np.where(level > 0.0, power / np.maximum(level, 1e-300), 0.0)
            total[c] += np.where(free, np.minimum(ratio, 1e3), 0.0)
            count[c] += free
            within += np.where(free, power - level, 0.0) * 3.0
            everything += float(power.sum())
    both, n = total.sum(axis=0), count.sum(axis=0)
    few = n < 0.4 * n.max()
    # neighbouring bins of a windowed spectrum are alike; treating them as different errs on the safe side
    tail = np.where(use & ~few & (n > 0.0), gamma.sf(both, np.maximum(n, 1.0)), 1.0)
    best = int(np.argmin(tail))
    probability = float(min(1.0, tail[best] * use.sum()))
    if probability > _LEAST:
        return None
    mean = total[:, best] / np.maximum(count[:, best], 1.0)
    return Line(
        float(grid[best]),
        f"cart_{1 + int(np.argmax(mean))}",
        float(max(within[best], 0.0) / max(everything, 1e-300)),
        probability,
    )


def _resonance(values: Mapping[str, float], frequency: FloatArray) -> FloatArray:
    """Return the power of each cart's velocity under forces of all frequencies on both, shape (2, frequencies), peaks 1."""
    drive = Drive(values).linear
    omega = 2.0 * np.pi * np.maximum(frequency, LOWEST_HZ)
    outputs: tuple[Output, ...] = ("x1",) if drive.rigid else ("x1", "x2")
    forces: tuple[Input, ...] = ("d1",) if drive.rigid else ("d1", "d2")
    found = np.ones((2, len(omega)))
    for row, x in zip(found, outputs, strict=False):
        power = np.sum([np.abs(drive.frequency_response(omega, x, d)) ** 2 for d in forces], axis=0)
        row[:] = np.maximum(power / np.max(power), _FAINTEST)
    return found

r"""What surrounds every rig and is nobody's left-out physics: a rough track, and friction that wanders within a run.

Both are random effects of every run, with forces on cart c of

.. math:: -\operatorname{sgn}(v_c)\, d_c \Bigl(\sum_k w_k \Lambda_k(t) + \sum_j r_j \sin(2\pi x_c/\lambda_j + \varphi_j)\Bigr)
   + \sum_j h_j \sin(2\pi x_c/\lambda_j + \varphi_j),

with hat functions :math:`\Lambda_k` every two seconds, wavelengths :math:`\lambda_j` half an octave apart, and standard
deviations of the size that two recorded rigs show. They are not estimated: a residual is full of other coloured errors, which
so many free amplitudes would take for their own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np
from scipy.ndimage import gaussian_filter1d

from flexdrive_gym.recording import FloatArray
from identification.mismatch.workbench import Workbench

WAVES_MM = (8.0, 12.0, 18.0, 27.0, 40.0, 60.0, 90.0)
KNOT_S = 2.0
# relative to the Coulomb level, relative to it, and [V]; the latter two per wave
WANDER, ROUGH, HILLS_V = 0.04, 0.03, 0.004
_RESTING = 5.0
_LEAST_LEVEL_V = 0.05

Forces = Callable[[], Sequence[FloatArray]]


def surroundings(bench: Workbench, values: Mapping[str, float]) -> tuple[list[Forces], list[float]]:
    """Return the forces of unit amplitude and their standard deviations.

    Returns
    -------
    forces
        Functions that return for every recording a force on each cart, ndarray, shape (2, n) [V].
    sizes
        Standard deviation of each amplitude.
    """
    longest = max(len(run.u) * run.sample_time for run in bench.runs)
    hats = [partial(_hat, bench, k * KNOT_S) for k in range(int(np.ceil(longest / KNOT_S)) + 1)]
    forces: list[Forces] = []
    sizes: list[float] = []
    for c in range(len(bench.runs[0].keep)):
        against = _against_motion(bench, c, max(values.get(f"d{c + 1}", 0.0), _LEAST_LEVEL_V))
        waves = [partial(_wave, bench, c, length, turn) for length in WAVES_MM for turn in (0.0, 0.5 * np.pi)]
        ones = [np.ones(len(run.u)) for run in bench.runs]
        for shapes, direction, size in ((hats, against, WANDER), (waves, against, ROUGH), (waves, ones, HILLS_V)):
            forces += [partial(_on_cart, c, direction, shape) for shape in shapes]
            sizes += [size] * len(shapes)
    return forces, sizes


def _against_motion(bench: Workbench, c: int, level: float) -> list[FloatArray]:
    found = []
    for run in bench.runs:
        v = gaussian_filter1d(run.measured[c], 0.004 / run.sample_time)
        found.append(-level * np.where(np.abs(v) > _RESTING, np.sign(v), 0.0))
    return found


def _hat(bench: Workbench, at: float, r: int) -> FloatArray:
    t = np.arange(len(bench.runs[r].u)) * bench.runs[r].sample_time
    return np.asarray(np.maximum(0.0, 1.0 - np.abs(t - at) / KNOT_S))


def _wave(bench: Workbench, c: int, length: float, turn: float, r: int) -> FloatArray:
    return np.asarray(np.sin(2.0 * np.pi * bench.runs[r].track[c] / length + turn))


def _on_cart(c: int, direction: Sequence[FloatArray], shape: Callable[[int], FloatArray]) -> list[FloatArray]:
    found = []
    for r, d in enumerate(direction):
        force = np.zeros((2, len(d)))
        force[c] = d * shape(r)
        found.append(force)
    return found

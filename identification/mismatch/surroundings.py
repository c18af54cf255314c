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
# slower than this [mm/s] a cart may rest
_RESTING, _SMOOTH_S = 5.0, 0.004
_LEAST_LEVEL_V = 0.05

# dry friction of a cart: in motion, and besides at rest or nearly
_SLIDING = ("d{0}", "presliding.cart_{0}.fd")
_AT_REST = ("stribeck.cart_{0}.extra", "breakaway.cart_{0}.extra")
# forces that are constant while a cart moves one way
_CONSTANT = ("input_offset.u0", "tilt.F", "coulomb_asymmetry.cart_{0}.a")

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
        level = dry_level(values, c)
        friction = [level * against(v) for v in speeds(bench, c)]
        waves = [partial(_wave, bench, c, length, turn) for length in WAVES_MM for turn in (0.0, 0.5 * np.pi)]
        ones = [np.ones(len(run.u)) for run in bench.runs]
        for shapes, direction, size in ((hats, friction, WANDER), (waves, friction, ROUGH), (waves, ones, HILLS_V)):
            forces += [partial(_on_cart, c, direction, shape) for shape in shapes]
            sizes += [size] * len(shapes)
    return forces, sizes


def speeds(bench: Workbench, c: int) -> list[FloatArray]:
    """Return a cart's measured velocity without the noise that would turn its sign [mm/s], per recording."""
    return [gaussian_filter1d(run.measured[c], _SMOOTH_S / run.sample_time) for run in bench.runs]


def against(v: FloatArray) -> FloatArray:
    """Return the direction of dry friction at a velocity [mm/s]: -1, 1, or 0 where it may rest."""
    return np.asarray(-np.where(np.abs(v) > _RESTING, np.sign(v), 0.0))


def dry_level(values: Mapping[str, float], c: int) -> float:
    """Return a cart's dry friction in motion [V]; never nothing, for no rig is without."""
    return max(sum(values.get(key.format(c + 1), 0.0) for key in _SLIDING), _LEAST_LEVEL_V)


def differs_between_runs(key: str) -> bool:
    """Whether a parameter is a level of dry friction or a constant force, which differ from run to run on every rig."""
    return any(key == own.format(c) for own in (*_SLIDING, *_AT_REST, *_CONSTANT) for c in (1, 2))


def rubbed(values: Mapping[str, float], factors: Sequence[float]) -> dict[str, float]:
    """Return a drive with all dry friction of each cart multiplied."""
    changed = dict(values)
    for c, factor in enumerate(factors, 1):
        keys = [key.format(c) for key in (*_SLIDING, *_AT_REST)]
        changed |= {key: factor * values[key] for key in keys if key in values}
    return changed


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

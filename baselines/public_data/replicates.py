r"""The score that friction alone makes, as it differs from run to run.

Blocks of the training recordings are the replicates: in each, the level of friction (one factor for all of b and d) and a
constant force are fitted beside the drive. What they differ by between blocks is their covariance. Drawn from it, they make runs
of the same drive, and the rms between such a run and the drive itself is a score that no model of the mean can better.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.optimize import least_squares

from baselines.public_data.benchmark import Benchmark, piece
from baselines.public_data.blocks import cut
from baselines.public_data.fitting import Piece, Values, piece_of, residual, simulated, started
from flexdrive_gym.recording import FloatArray, Recording

_FRICTION = ("b1", "b2", "d1", "d2")
_FORCE = "input_offset.u0"
_DRAWS = 200


def changed(values: Values, level: FloatArray) -> dict[str, float]:
    """Return a drive with its friction by a factor ``1 + level[0]``, and a constant force ``level[1]`` [V] more."""
    friction: Mapping[str, float] = {k: values[k] * (1.0 + float(level[0])) for k in _FRICTION if values.get(k)}
    return {**values, **friction, _FORCE: values.get(_FORCE, 0.0) + float(level[1])}


def levels(values: Values, recordings: Sequence[Recording], benchmark: Benchmark) -> FloatArray:
    """Return friction level and constant force of every block, ndarray, shape (blocks, 2)."""
    rows = []
    for r in recordings:
        for begin, end in cut(r, benchmark.blocks):
            p = started(values, piece_of(piece(r, begin, end, r.name)), benchmark)
            rows.append(_level(values, p, benchmark))
    return np.array(rows)


def _level(values: Values, p: Piece, benchmark: Benchmark) -> FloatArray:
    scale = np.array([0.01, 0.01 * float(np.std(p.run.u))])

    def errors(z: FloatArray) -> FloatArray:
        return residual(changed(values, scale * z), p, benchmark)

    found = least_squares(errors, np.zeros(2), diff_step=np.full(2, 1e-2), max_nfev=12)
    return np.asarray(scale * found.x)


def friction_scores(
    values: Values, recordings: Sequence[Recording], target: Recording, benchmark: Benchmark, rng: np.random.Generator
) -> tuple[float, float, float]:
    """Return the 2.5 %, 50 % and 97.5 % quantiles of the score that run-to-run friction alone makes [unit of the rule].

    Parameters
    ----------
    values
        The drive.
    recordings
        Whose blocks are the replicates.
    target
        Recording whose command is simulated.
    """
    spread = np.cov(levels(values, recordings, benchmark).T)
    p = started(values, piece_of(target), benchmark)
    usual = simulated(values, p)
    draws = rng.multivariate_normal(np.zeros(2), spread, size=_DRAWS)
    scores = [benchmark.score(simulated(changed(values, level), p) - usual) for level in draws]
    low, middle, high = np.quantile(scores, (0.025, 0.5, 0.975))
    return float(low), float(middle), float(high)

r"""What differs between runs of the same rig, and how far its recordings reach: what a prediction needs besides the covariance.

Dry friction is not the same in every run. With the drive held, every run gets factors :math:`e^{z_g}` on its own d1 and d2 that
fit it best, and what they are worth: a robust information :math:`A_g = H_g S_g^{-1} H_g` of :math:`z_g` with
:math:`H_g = J_g^T J_g` and :math:`S_g` the sum of outer products of the scores of the parts of that run, for neighbouring
residuals are correlated. The factors scatter by the covariance D of runs and by their errors; D is estimated as that of random
effects by expectation-maximisation,

.. math:: V_g = (A_g + D^{-1})^{-1}, \quad m_g = V_g A_g z_g, \quad D = \tfrac1G \sum_g \text{diag}(m_g m_g^T + V_g),

about zero, because the drive is what is predicted from: one whose friction lies aside of that of its runs is uncertain by that,
too. D is diagonal: carts on bearings of their own vary each for itself. What looks like friction that moves from one cart to the
other is a model that lacks a force between them. N. Laird, J. Ware, Random-effects models for longitudinal data, Biometrics 38,
1982.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor

import numpy as np
from scipy.optimize import least_squares

from flexdrive_gym.drive.drive import Covariance, Recorded
from flexdrive_gym.recording import FloatArray, Recording
from identification.replay.output_error import Run, simulate_run
from identification.signals import motions

FRICTION = ("d1", "d2")
# a run's own friction is between a fifth and five times the drive's
_FARTHEST = 1.6
# stick-slip makes residuals smooth only piece by piece
_STEP = 1e-2
# parts of a run whose residuals are taken for independent: a second of the handout's eight
_PARTS = 8
_FEWEST = 3
_ITERATIONS = 200
# standard deviation from which the estimate starts
_START = 0.2
# a square has harmonics; its ninth still has a ninth of its amplitude
_HARMONICS = {"square": 9.0}


def friction_run_to_run(
    values: Mapping[str, float], runs: Sequence[Run], pool: Executor | None = None
) -> Covariance | None:
    """Return the covariance of the logarithms of d1 and d2 between runs.

    Parameters
    ----------
    values
        Of the drive that fits them all.
    runs
        Prepared recordings.
    pool
        Fits the runs on its threads.

    Returns
    -------
    Covariance or None
        ``None`` with fewer than three runs, or for a drive without dry friction.
    """
    names = tuple(n for n in FRICTION if values.get(n, 0.0) > 0.0)
    if len(runs) < _FEWEST or not names:
        return None

    def one(run: Run) -> tuple[FloatArray, FloatArray]:
        return _own_factors(values, run, names)

    found = list(map(one, runs) if pool is None else pool.map(one, runs))
    return Covariance(names, _between(*map(np.array, zip(*found, strict=True))))


def _own_factors(values: Mapping[str, float], run: Run, names: tuple[str, ...]) -> tuple[FloatArray, FloatArray]:
    """Return the log factors that fit one run best, and their information."""

    def residuals(z: FloatArray) -> FloatArray:
        own = {**values, **{n: values[n] * float(np.exp(x)) for n, x in zip(names, z, strict=True)}}
        simulated = simulate_run(own, run)
        return np.concatenate(
            [run.blocks(c, m - s) for c, (m, s) in enumerate(zip(run.measured, simulated, strict=True))]
        )

    def jacobian(z: FloatArray) -> FloatArray:
        # either way, so that the derivative is centred: friction that stops a cart acts on one side only
        return np.column_stack([(residuals(z + e) - residuals(z - e)) / (2.0 * _STEP) for e in _STEP * np.eye(len(z))])

    found = least_squares(residuals, np.zeros(len(names)), jacobian, (-_FARTHEST, _FARTHEST), max_nfev=8, ftol=1e-3)
    J, r = jacobian(found.x), residuals(found.x)
    length = len(run.u) * run.sample_time
    parts = np.concatenate(
        [(_PARTS * run.block_times(c) / length).astype(int) for c in range(len(run.keep))], dtype=np.int64
    )
    scores = np.zeros((_PARTS, len(names)))
    np.add.at(scores, np.minimum(parts, _PARTS - 1), J * r[:, None])
    H, S = J.T @ J, scores.T @ scores
    return found.x, H @ np.linalg.pinv(S, rcond=1e-9, hermitian=True) @ H


def _between(z: FloatArray, information: FloatArray) -> FloatArray:
    """Return the diagonal covariance of random effects with known information, about zero, shape (n, n)."""
    D = _START**2 * np.eye(z.shape[1])
    moved = np.einsum("gij,gj->gi", information, z)
    for _ in range(_ITERATIONS):
        # (A + 1/D)^-1 without the inverse of D, which may vanish
        V = np.array([D @ np.linalg.inv(np.eye(len(D)) + A @ D) for A in information])
        m = np.einsum("gij,gj->gi", V, moved)
        D = np.diag(np.diag(m.T @ m + V.sum(axis=0)) / len(z))
    return np.asarray(D)


def recorded_range(recordings: Sequence[Recording]) -> Recorded:
    """Return how far recordings reach in command, speed, deflection, frequency and travel."""
    u, v, deflection, travel = 0.0, 0.0, 0.0, 0.0
    slowest, fastest = np.inf, 0.0
    for r in recordings:
        u = max(u, float(np.max(np.abs(r.u))))
        speeds, keep = motions(r)
        width = max(1, round(5e-3 / r.sample_time))
        smooth = [
            np.convolve(np.where(k, x, 0.0), np.ones(width) / width, "same") for x, k in zip(speeds, keep, strict=True)
        ]
        v = max([v, *(float(np.max(np.abs(x))) for x in smooth)])
        ways = [np.cumsum(np.where(k, x, 0.0)) * r.sample_time for x, k in zip(speeds, keep, strict=True)]
        travel = max([travel, *(float(np.ptp(x)) for x in ways)])
        if len(speeds) > 1:
            # where the spring began is unknown, and a lost count shifts it: the middle is taken for its rest
            apart = np.cumsum(np.where(keep[0] & keep[1], speeds[0] - speeds[1], 0.0)) * r.sample_time
            if r.x1 is not None and r.x2 is not None:
                apart = r.x1 - r.x2
            deflection = max(deflection, float(np.ptp(apart)) / 2.0)
        f = r.excitation.frequency
        if f:
            slowest, fastest = min(slowest, f), max(fastest, f * _HARMONICS.get(r.excitation.kind, 1.0))
    if fastest == 0.0:
        slowest, fastest = 0.0, np.inf
    return Recorded(u, v, deflection, float(slowest), float(fastest), travel)

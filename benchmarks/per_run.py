"""One drive for all runs, and what each run may have of its own: friction levels, a constant force, a preload of the spring.

Least squares on block means of v1 and v2, every recording with the same weight per sample, weak priors on what is a run's own.
Not a diagnosis: a question of a benchmark, asked with one effect after the other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from flexdrive_gym.drive.parameters import parameter
from flexdrive_gym.recording import FloatArray
from identification.replay.output_error import Run, simulate_run

FREE = ("m1", "m2", "k", "b1", "b2", "d1", "d2")
# of a run's own: factors of d1 and d2 (as logarithms), constant force [V], preload of the spring [mm]; standard deviations of the
# priors and bounds, several times what replicates of such a rig differ by
OWN = 4
_PRIOR = np.array([0.7, 0.7, 0.2, 3.0])
_BOUND = np.array([2.5, 2.5, 1.0, 8.0])
# what an rms of 5 mm/s is worth
_ERROR = 5.0
# stick-slip makes the residuals smooth only piece by piece
_STEP = 2e-3


@dataclass(frozen=True, eq=False)
class PerRun:
    """A fit.

    Attributes
    ----------
    values
        Of the drive.
    own
        Per run, ndarray, shape (runs, 4): log factor of d1, of d2, constant force [V], preload [mm].
    errors
        Their standard errors.
    rms
        Per run [mm/s], shape (runs,).
    total
        Over all runs [mm/s].
    """

    values: dict[str, float]
    own: FloatArray
    errors: FloatArray
    rms: FloatArray
    total: float


class _Problem:
    def __init__(
        self, runs: Sequence[Run], start: Mapping[str, float], free: Sequence[str], pool: ThreadPoolExecutor
    ) -> None:
        self.runs, self.free, self.pool, self.start = runs, tuple(free), pool, dict(start)
        # sizes that may have either sign, or be nothing, are no logarithms
        self.log = np.array([parameter(n).lower >= 0.0 and start[n] > 0.0 for n in free])
        self.scale = np.array([1.0 if log else abs(start[n]) or 1.0 for n, log in zip(free, self.log, strict=True)])
        self.n = len(free)

    def begin(self, own: FloatArray) -> FloatArray:
        x = np.array([self.start[n] for n in self.free])
        return np.concatenate([np.where(self.log, np.log(np.maximum(x, 1e-12)), x / self.scale), own.ravel()])

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        low = np.array([parameter(n).lower for n in self.free])
        high = np.minimum([parameter(n).upper for n in self.free], 1e3)
        own = np.tile(_BOUND, len(self.runs))
        low = np.where(self.log, np.log(np.maximum(low, 1e-9)), low / self.scale)
        return np.concatenate([low, -own]), np.concatenate([np.where(self.log, np.log(high), high / self.scale), own])

    def values(self, z: FloatArray) -> dict[str, float]:
        x = np.where(self.log, np.exp(np.where(self.log, z[: self.n], 0.0)), z[: self.n] * self.scale)
        return {**self.start, **{n: float(v) for n, v in zip(self.free, x, strict=True)}}

    def own(self, z: FloatArray) -> FloatArray:
        return np.asarray(z[self.n :].reshape(len(self.runs), OWN))

    def simulated(self, z: FloatArray, i: int) -> list[FloatArray]:
        return simulate(self.values(z), self.runs[i], self.own(z)[i])

    def block(self, z: FloatArray, i: int) -> FloatArray:
        run = self.runs[i]
        simulated = self.simulated(z, i)
        parts = [run.blocks(c, m - s) for c, (m, s) in enumerate(zip(run.measured, simulated, strict=True))]
        return np.concatenate(parts) / (_ERROR * np.sqrt(run.block))

    def residuals(self, z: FloatArray) -> FloatArray:
        parts = list(self.pool.map(lambda i: self.block(z, i), range(len(self.runs))))
        return np.concatenate([*parts, (self.own(z) / _PRIOR).ravel()])

    def jacobian(self, z: FloatArray) -> FloatArray:
        here = [self.block(z, i) for i in range(len(self.runs))]
        ends = np.cumsum([0, *map(len, here)])
        total = np.zeros((ends[-1] + OWN * len(self.runs), len(z)))
        total[ends[-1] :, self.n :] = np.diag(np.tile(1.0 / _PRIOR, len(self.runs)))

        def fill(i: int) -> None:
            columns = [*range(self.n), *range(self.n + OWN * i, self.n + OWN * (i + 1))]
            for column in columns:
                up = z.copy()
                up[column] += _STEP
                total[ends[i] : ends[i + 1], column] = (self.block(up, i) - here[i]) / _STEP

        list(self.pool.map(fill, range(len(self.runs))))
        return total


def simulate(values: Mapping[str, float], run: Run, own: FloatArray) -> list[FloatArray]:
    """Return v1 and v2 of a run with what is its own [mm/s]."""
    begin = run.start.copy()
    begin[0] += own[3]
    factors = {"d1": values["d1"] * float(np.exp(own[0])), "d2": values["d2"] * float(np.exp(own[1]))}
    return simulate_run({**values, **factors}, replace(run, u=run.u + own[2], start=begin))


def fit_per_run(
    runs: Sequence[Run],
    start: Mapping[str, float],
    more: Sequence[str] = (),
    own: FloatArray | None = None,
    most: int = 12,
) -> PerRun:
    """Fit a drive with further parameters to all runs, each with its own friction, constant force and preload."""
    with ThreadPoolExecutor(2) as pool:
        problem = _Problem(runs, start, (*FREE, *more), pool)
        low, high = problem.bounds()
        begin = np.clip(problem.begin(np.zeros((len(runs), OWN)) if own is None else own), low + 1e-6, high - 1e-6)
        found = least_squares(
            problem.residuals, begin, problem.jacobian, (low, high), ftol=1e-4, xtol=1e-5, max_nfev=most, x_scale="jac"
        )
        z = found.x
        errors = np.sqrt(np.maximum(np.diag(np.linalg.pinv(found.jac.T @ found.jac)), 0.0))[problem.n :].reshape(
            len(runs), OWN
        )
        squares, counts = np.zeros(len(runs)), np.zeros(len(runs))
        for i, run in enumerate(runs):
            for m, s, keep in zip(run.measured, problem.simulated(z, i), run.keep, strict=True):
                squares[i] += float(np.sum((m - s)[keep] ** 2))
                counts[i] += int(keep.sum())
        total = float(np.sqrt(squares.sum() / counts.sum()))
        return PerRun(problem.values(z), problem.own(z), errors, np.sqrt(squares / counts), total)

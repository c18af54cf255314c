"""The descent that maximum likelihood takes: least squares over all runs, reweighted by what each channel turns out to err."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from scipy.optimize import least_squares

from flexdrive_gym.drive.parameters import parameter
from flexdrive_gym.recording import FloatArray
from identification.quantities import RATIOS
from identification.replay.output_error import Run, block_residuals

LOGARITHMIC = frozenset({"m1", "m2", "k"})
# no mass or stiffness is less or more, in any unit that a rig is recorded in
_LEAST, _MOST = 1e-9, 1e9


class Descent:
    """Weighted least squares in scaled coordinates: masses and stiffness as logarithms, friction relative to its start."""

    def __init__(
        self,
        runs: Sequence[Run],
        names: Sequence[str],
        ties: Mapping[str, float],
        fixed: Mapping[str, float],
        pool: ThreadPoolExecutor,
    ) -> None:
        self.runs, self.names, self.ties, self.fixed, self.pool = runs, tuple(names), ties, fixed, pool
        self.log = np.array([name in LOGARITHMIC for name in names])
        self.scale = np.ones(len(names))
        self.weights: list[float] = []

    def values(self, z: FloatArray) -> dict[str, float]:
        """Return the drive at coordinates z, with what is tied and what is fixed."""
        theta = np.where(self.log, np.exp(np.where(self.log, z, 0.0)), z * self.scale)
        values = {**self.fixed, **{name: float(x) for name, x in zip(self.names, theta, strict=True)}}
        for ratio, factor in self.ties.items():
            dependent, free = RATIOS[ratio]
            values[dependent] = factor * values[free]
        return values

    def coordinates(self, values: Mapping[str, float]) -> FloatArray:
        """Return the coordinates of a drive."""
        theta = np.array([values[name] for name in self.names])
        return np.where(self.log, np.log(np.maximum(theta, _LEAST)), theta / self.scale)

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Return the least and the greatest coordinates; what is tied to a parameter keeps within its own bounds, too."""
        factors = {RATIOS[ratio][1]: factor for ratio, factor in self.ties.items()}
        least = np.array([parameter(n).lower / min(factors.get(n, 1.0), 1.0) for n in self.names])
        most = np.array([parameter(n).upper for n in self.names])
        low = np.where(self.log, np.log(np.maximum(least, _LEAST)), least / self.scale)
        return low, np.where(self.log, np.log(np.minimum(most, _MOST)), most / self.scale)

    def resting(self, z: FloatArray) -> list[str]:
        """Return the masses and stiffnesses that rest at a bound, to a tenth: bounds lie decades away from any rig."""
        low, high = self.bounds()
        near = self.log & (np.minimum(z - low, high - z) < 0.1)
        return [n for n, rests in zip(self.names, near, strict=True) if rests]

    def residuals(self, z: FloatArray, *, parallel: bool = True) -> FloatArray:
        """Return the weighted residuals of all runs and carts, shape (N,)."""
        parts = block_residuals(self.values(z), self.runs, self.pool if parallel else None)
        return np.concatenate([r * w for r, w in zip(parts, self.weights, strict=True)])

    def jacobian(self, z: FloatArray) -> FloatArray:
        """Return their derivatives, shape (N, coordinates)."""
        # a step far above round-off: stick-slip makes the residuals smooth only piece by piece
        step = 1e-3

        def column(i: int) -> FloatArray:
            up = z.copy()
            up[i] += step
            return (self.residuals(up, parallel=False) - here) / step

        here = self.residuals(z)
        return np.column_stack(list(self.pool.map(column, range(len(z)))))

    def reweight(self, z: FloatArray) -> float:
        """Set the weights from the residuals at z; return the negative log-likelihood there."""
        parts = block_residuals(self.values(z), self.runs, self.pool)
        n = np.array([len(r) for r in parts])
        own = np.array([float(r @ r) / max(len(r), 1) for r in parts])
        floor = np.array([f for run in self.runs for f in run.floor])
        error = max(float((own - floor) @ n / n.sum()), 0.01 * float(own @ n / n.sum()))
        variances = floor + error
        self.weights = [float(w) for w in 1.0 / np.sqrt(variances)]
        return float(0.5 * np.sum(n * (np.log(variances) + own / variances)))

    def descend(
        self, values: Mapping[str, float], rounds: int, evaluations: int
    ) -> tuple[FloatArray, float, bool, dict[str, float]]:
        """Fit from these values, reweighting after every round; return z, its cost, whether it was found, the drive."""
        self.scale = np.array([max(abs(values[n]), 0.05 * _typical(n, values)) for n in self.names])
        low, high = self.bounds()
        z = np.clip(self.coordinates(values), low + 1e-9, high - 1e-9)
        cost, done = self.reweight(z), False
        for _ in range(rounds):
            found = least_squares(
                self.residuals, z, self.jacobian, (low, high), ftol=1e-5, xtol=1e-5, max_nfev=evaluations
            )
            z, previous = np.clip(found.x, low + 1e-9, high - 1e-9), cost
            cost, done = self.reweight(z), found.status > 0
            if abs(previous - cost) < 1e-5 * abs(cost):
                break
        return z, cost, done, self.values(z)


def _typical(name: str, values: Mapping[str, float]) -> float:
    """Size against which a friction of zero is small; an effect's own usual size."""
    if "." in name:
        return max([abs(begin) for begin in parameter(name).starts] or [1.0])
    same = [v for n, v in values.items() if n[0] == name[0]]
    return max([*same, 1e-6])

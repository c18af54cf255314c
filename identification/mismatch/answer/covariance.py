r"""How uncertain a fitted drive is: the jackknife over experiments, studentised by simulated data sets.

Experiments are the independent things, for neighbouring residuals err alike, and so do replicates. With the others' optimum
:math:`\Delta_{-u}` of :mod:`identification.mismatch.fitting.score`, the covariance of U units is

.. math:: \frac{U-1}{U} \sum_u (\Delta_{-u} - \bar\Delta)(\Delta_{-u} - \bar\Delta)^T .

B. Efron, C. Stein, The jackknife estimate of variance, Ann. Statist. 9, 1981. It does not see what all recordings share, which
is the track; it takes weights as given that the recordings' own errors set; and few experiments may tell most of a parameter.
How far an estimate is off in its own standard errors is therefore told by data sets that are simulated around it, with the
same estimator: an interval is as many standard errors as 95 % of them need (P. Hall, Theoretical comparison of bootstrap
confidence intervals, Ann. Statist. 16, 1988). Parameters that rest at a bound have no part in it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from flexdrive_gym.drive.drive import Covariance
from flexdrive_gym.drive.parameters import parameter
from flexdrive_gym.recording import FloatArray
from identification.mismatch.fitting.bench import Bench, Columns
from identification.mismatch.fitting.fit import Coordinates, Fit
from identification.mismatch.fitting.score import Normal
from identification.mismatch.noise.marginal import Marginal

Limits = dict[str, tuple[float, float]]
# a logarithm this uncertain says nothing, and its exponential is still a number
_UNKNOWN = 300.0


def uncertainty(best: Fit, simulated: Columns) -> tuple[Limits, Covariance | None]:
    """Return the 95 % intervals of all fitted parameters, and their joint covariance in their own units.

    Parameters
    ----------
    best
        Fit by output error beside run-to-run variability.
    simulated : ndarray, shape (N, draws)
        Raw rows of simulated data sets against that drive.

    Returns
    -------
    dict
        Parameter to interval; of no width at a bound.
    Covariance or None
        Of the parameters that do not rest at a bound; ``None`` for a single unit.
    """
    U = len(best.normal.square)
    inner = [name for name, i in zip(best.names, best.interior, strict=True) if i]
    spread = _jackknife(best.normal, best.bench.settings.damping)
    usual = float(student.ppf(0.975, max(U - 1, 1)))
    if U > 1 and inner:
        # intervals of Student's t with this covariance are those that the draws ask for
        wider = _errors(best, simulated) / usual
        spread = spread * np.outer(wider, wider)
    half = usual * np.sqrt(np.diag(spread))
    scale = best.scale[best.interior]
    logarithmic = dict(zip(best.names, Coordinates(best.names, best.values).log, strict=True))
    limits = {name: (best.values[name], best.values[name]) for name in best.names}
    for name, s, h in zip(inner, scale, half, strict=True):
        q, value = parameter(name), best.values[name]
        if logarithmic[name]:
            low, high = value * np.exp(-min(h, _UNKNOWN)), value * np.exp(min(h, _UNKNOWN))
        else:
            low, high = value - h * s, value + h * s
        limits[name] = (float(max(low, q.lower)), float(min(high, q.upper)))
    if U < 2 or not inner:
        return limits, None
    return limits, Covariance(tuple(inner), spread * np.outer(scale, scale), U - 1.0)


def _jackknife(normal: Normal, damping: float) -> FloatArray:
    """Return the covariance of the scaled coordinates, shape (p, p)."""
    steps = normal.steps(damping)
    apart, U = steps - steps.mean(axis=0), len(steps)
    return np.asarray((U - 1.0) / U * apart.T @ apart)


def _errors(best: Fit, simulated: Columns) -> FloatArray:
    """Return within how many of its own standard errors 95 % of simulated estimates lie, shape (p,)."""
    damping = best.bench.settings.damping
    sums = _Sums.of(best, simulated)
    weights = np.repeat(sums.weights[:, None], simulated.shape[1], axis=1)
    first = np.array([n.solve(damping) for n in sums.normal(weights)]).T
    # weights are those of the draw's own errors, as they are in the data
    own = sums.normal(sums.again(weights, first))
    found = [n.solve(damping) / np.sqrt(np.maximum(np.diag(_jackknife(n, damping)), 1e-300)) for n in own]
    return np.asarray(np.quantile(np.abs(found), 0.95, axis=0))


@dataclass(frozen=True, eq=False)
class _Sums:
    """Products of what differs from run to run, derivatives and simulated rows, over the rows of a recording and cart.

    Attributes
    ----------
    bench
        Recordings.
    weights : ndarray, shape (P,)
        Of squares in every piece of the fit's metric.
    k
        Number of amplitudes of a recording.
    columns : ndarray, shape (P, k + p, k + p)
        Of amplitudes and derivatives.
    mixed : ndarray, shape (P, k + p, draws)
        Of these with simulated rows.
    square : ndarray, shape (P, draws)
        Of simulated rows.
    """

    bench: Bench
    weights: FloatArray
    k: int
    columns: FloatArray
    mixed: FloatArray
    square: FloatArray

    @classmethod
    def of(cls, best: Fit, simulated: Columns) -> _Sums:
        bench, metric = best.bench, best.metric
        if not isinstance(metric, Marginal):
            raise TypeError(f"best: must be a fit by output error; got one in the metric {type(metric).__name__}.")
        made, weights = metric.made, metric.levels.weights
        columns, mixed, square = [], [], []
        for piece in bench.pieces:
            own = bench.valid[piece.rows]
            x = np.column_stack([made[piece.rows], best.jacobian[piece.rows][:, best.interior]])[own]
            y = simulated[piece.rows][own].astype(np.float64)
            columns.append(x.T @ x)
            mixed.append(x.T @ y)
            square.append(np.sum(y**2, axis=0))
        most = np.array([np.max(weights[p.rows], initial=0.0) ** 2 for p in bench.pieces])
        return cls(bench, most, made.shape[1], np.array(columns), np.array(mixed), np.array(square))

    def normal(self, weights: FloatArray) -> list[Normal]:
        """Return the normal equations of every draw, with weights of the shape (P, draws)."""
        bench, p, draws = self.bench, self.columns.shape[1] - self.k, weights.shape[1]
        found = np.zeros((draws, int(bench.units.max()) + 1, p + 1, p + 1))
        for r, unit in enumerate(bench.units):
            whole, solved = self._recording(r, weights)
            a, b = slice(None, self.k), slice(self.k, None)
            found[:, unit] += whole[:, b, b] - np.swapaxes(whole[:, a, b], 1, 2) @ solved
        return [Normal.of(one) for one in found]

    def again(self, weights: FloatArray, step: FloatArray) -> FloatArray:
        """Return the weights of what amplitudes leave after a step of the parameters, shape (p, draws)."""
        draws, found = weights.shape[1], np.empty_like(weights)
        after = np.vstack([step, np.ones(draws)]).T[:, :, None]
        for r in range(len(self.bench.runs)):
            amplitude = -(self._recording(r, weights)[1] @ after)[:, :, 0].T
            x = np.vstack([amplitude, step])
            for i, piece in enumerate(self.bench.pieces):
                if piece.recording == r:
                    left = self.square[i] + np.sum(x * (self.columns[i] @ x + 2.0 * self.mixed[i]), axis=0)
                    mean = left / max(int(self.bench.valid[piece.rows].sum()), 1)
                    found[i] = 1.0 / np.maximum(mean, float(self.bench.floor[i]))
        return found

    def _recording(self, r: int, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the products in a recording, shape (draws, k + p + 1, k + p + 1), and amplitudes' share of the others."""
        n = self.columns.shape[1]
        whole = np.zeros((weights.shape[1], n + 1, n + 1))
        for i, piece in enumerate(self.bench.pieces):
            if piece.recording == r:
                w = weights[i]
                whole[:, :n, :n] += w[:, None, None] * self.columns[i]
                whole[:, :n, n] += (w * self.mixed[i]).T
                whole[:, n, n] += w * self.square[i]
        whole[:, n, :n] = whole[:, :n, n]
        amplitudes = whole[:, : self.k, : self.k] + np.eye(self.k)
        return whole, np.asarray(np.linalg.solve(amplitudes, whole[:, : self.k, self.k :]))

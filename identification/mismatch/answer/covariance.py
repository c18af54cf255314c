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

import numpy as np
from scipy.stats import t as student

from flexdrive_gym.drive.drive import Covariance
from flexdrive_gym.drive.parameters import parameter
from flexdrive_gym.recording import FloatArray
from identification.mismatch.fitting.bench import Columns
from identification.mismatch.fitting.fit import Coordinates, Fit, Metric
from identification.mismatch.fitting.levels import Levels
from identification.mismatch.fitting.score import Normal

Limits = dict[str, tuple[float, float]]
# a logarithm this uncertain says nothing, and its exponential is still a number
_UNKNOWN = 300.0


def uncertainty(best: Fit, simulated: Columns) -> tuple[Limits, Covariance | None]:
    """Return the 95 % intervals of all fitted parameters, and their joint covariance in their own units.

    Parameters
    ----------
    best
        Fit by output error.
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
    bench, damping = best.bench, best.bench.settings.damping
    inner = best.jacobian[:, best.interior]

    def normal(metric: Metric, rows: FloatArray) -> Normal:
        return Normal.of(bench.products(metric.white(np.column_stack([inner, rows]))))

    def error(rows: FloatArray) -> FloatArray:
        first = normal(best.metric, rows).solve(damping)
        # weights are those of the draw's own errors, as they are in the data
        own = normal(Levels.of(bench, rows + inner @ first), rows)
        return own.solve(damping) / np.sqrt(np.maximum(np.diag(_jackknife(own, damping)), 1e-300))

    found = np.array(list(bench.pool.map(error, simulated.T)))
    return np.asarray(np.quantile(np.abs(found), 0.95, axis=0))

r"""How uncertain a fitted drive is: the jackknife over experiments.

Experiments are the independent things, for neighbouring residuals err alike, and so do replicates. With the others' optimum
:math:`\Delta_{-u}` of :mod:`identification.mismatch.fitting.score`, the covariance of U units is

.. math:: \frac{U-1}{U} \sum_u (\Delta_{-u} - \bar\Delta)(\Delta_{-u} - \bar\Delta)^T ,

and intervals use Student's t with U - 1 degrees of freedom. Parameters that rest at a bound have no part in it.
B. Efron, C. Stein, The jackknife estimate of variance, Ann. Statist. 9, 1981.
"""

from __future__ import annotations

import numpy as np

from flexdrive_gym.drive.drive import Covariance
from flexdrive_gym.drive.parameters import parameter
from flexdrive_gym.recording import FloatArray
from identification.mismatch.fitting.fit import Coordinates, Fit

Limits = dict[str, tuple[float, float]]
# a logarithm this uncertain says nothing, and its exponential is still a number
_UNKNOWN = 300.0


def uncertainty(best: Fit) -> tuple[Limits, Covariance | None]:
    """Return the 95 % intervals of all fitted parameters, and their joint covariance in their own units.

    Returns
    -------
    dict
        Parameter to interval; of no width at a bound.
    Covariance or None
        Of the parameters that do not rest at a bound; ``None`` for a single unit.
    """
    from scipy.stats import t as student  # noqa: PLC0415

    spread = _jackknife(best)
    U = len(best.normal.square)
    half = float(student.ppf(0.975, max(U - 1, 1))) * np.sqrt(np.diag(spread))
    inner = [name for name, i in zip(best.names, best.interior, strict=True) if i]
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


def _jackknife(best: Fit) -> FloatArray:
    """Return the covariance of the scaled coordinates, shape (p, p)."""
    steps = best.normal.steps(best.bench.settings.damping)
    apart, U = steps - steps.mean(axis=0), len(steps)
    return np.asarray((U - 1.0) / U * apart.T @ apart)

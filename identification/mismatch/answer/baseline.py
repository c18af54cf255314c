"""The base model of two carts: do the handout's ratios hold, and what does it cost to hold them?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.stats import t as student

from flexdrive_gym import Drive
from flexdrive_gym.drive.parameters import checked
from flexdrive_gym.recording import FloatArray
from identification.mismatch.fitting.bench import Bench, Values
from identification.mismatch.fitting.fit import Fit, fit
from identification.quantities import HANDOUT_RATIOS, RATIOS, Quantity, derived_quantities


class _Tied(Bench):
    """Recordings whose drives all have the handout's ratios."""

    def __init__(self, bench: Bench) -> None:
        self.__dict__.update(bench.__dict__)

    def residual(self, values: Values, pushes: Sequence[FloatArray] | None = None) -> FloatArray:
        return super().residual(tied(values), pushes)


def tied(values: Values) -> dict[str, float]:
    """Return a drive with the handout's ratios."""
    return {**values, **{n: HANDOUT_RATIOS[r] * values.get(free, 0.0) for r, (n, free) in RATIOS.items()}}


def fit_tied(bench: Bench, base: Fit) -> Drive:
    """Fit the base model with the handout's ratios held, in the metric of its free optimum."""
    start = dict(base.values)
    for ratio, (n, free) in RATIOS.items():
        # the sum is what both agree on
        start[free] = (start[free] + start[n]) / (1.0 + HANDOUT_RATIOS[ratio])
    names = [n for n in base.names if n not in {n for n, _ in RATIOS.values()}]
    best = fit(_Tied(bench), base.metric, tied(start), names)
    return Drive(checked(tied(best.values)), name="handout's ratios")


def ratios(drive: Drive) -> Mapping[str, Quantity]:
    """Return alpha, beta and gamma of a drive with their 95 % intervals; empty for other than two carts and a spring."""
    if drive.carts == 1 or not {"m1", "m2", "k"} <= set(drive.values):
        return {}
    degrees = 1.0 if drive.covariance is None else max(drive.covariance.degrees, 1.0)
    quantile = float(student.ppf(0.975, degrees)) if np.isfinite(degrees) else 1.96
    return derived_quantities(drive, {}, quantile)[1]

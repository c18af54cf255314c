r"""Is the size of an effect the same in all experiments? What would do as well with another size in each is another law.

At the optimum of a model, experiment u alone asks for sizes that are off by :math:`-H_u^{-1} g_u`, with a covariance of
:math:`H_u^{-1}`: gradient and information of the whitened rows by these sizes. Where all have the same,
:math:`\sum g_u^T H_u^{-1} g_u` is a chi-squared of as many degrees of freedom as there are sizes, times one less than there are
experiments (W. G. Cochran, Biometrics 10, 1954).
"""

from __future__ import annotations

import numpy as np
from scipy.stats import chi2

from identification.mismatch.candidates.catalogue import Candidate
from identification.mismatch.fitting.fit import Fit

# of fewer experiments, the largest left out, nothing is known
_FEWEST = 4
# share of the largest eigenvalue under which an experiment tells nothing of a combination of sizes
_TOLD = 1e-6


def differs(model: Fit, candidate: Candidate, level: float) -> bool:
    """Whether sizes of an effect differ between experiments, by more than noise makes and friction differs by from run to run.

    Sizes are asked together: one that is nearly zero may well differ by more than itself. What one experiment alone shows is no
    property of a rig, so the largest is left out; the sum is then compared with a chi-squared that is larger than its own
    distribution.

    Parameters
    ----------
    model
        The drive with everything that has a name, in the metric of its noise.
    candidate
        The effect; sizes that rest at a bound say nothing.
    level
        Of the test.
    """
    inner = [name for name, inside in zip(model.names, model.interior, strict=True) if inside]
    keys = [key for key, _ in candidate.sizes if key in inner]
    normal, coordinates = model.normal, model.coordinates
    experiments = len(normal.square)
    if experiments < _FEWEST or not keys:
        return False
    at, own = [inner.index(key) for key in keys], [model.names.index(key) for key in keys]
    information, gradient = normal.information[:, at][:, :, at], normal.gradient[:, at]
    inverse = np.linalg.pinv(information, rcond=_TOLD, hermitian=True)
    each = np.einsum("ui,uij,uj->u", gradient, inverse, gradient)
    square, free = float(each.sum() - each.max()), len(keys) * (experiments - 2)
    # what the sizes are, over the standard errors of that
    size = np.where(coordinates.log[own], 1.0, coordinates.of(model.values)[own])
    whole = float(size @ information.sum(axis=0) @ size)
    return bool(chi2.sf(square, free) <= level and square - free > model.bench.settings.one_size * whole)

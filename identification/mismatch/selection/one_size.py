r"""Is the size of an effect the same in all experiments? What would do as well with another size in each is another law.

At the optimum of a model, experiment u alone asks for a size that is off by :math:`-g_u / h_u`, with a variance of
:math:`1 / h_u`: gradient and information of the whitened rows by that size. Where all have one size, :math:`\sum g_u^2 / h_u` is
a chi-squared of one degree of freedom less than there are experiments (W. G. Cochran, Biometrics 10, 1954).
"""

from __future__ import annotations

import numpy as np
from scipy.stats import chi2

from identification.mismatch.candidates.catalogue import Candidate
from identification.mismatch.fitting.fit import Fit

# of fewer experiments, the largest left out, nothing is known
_FEWEST = 4


def differs(model: Fit, candidate: Candidate, level: float) -> bool:
    """Whether a size of an effect differs between experiments, by more than noise makes and friction differs by from run to run.

    What one experiment alone shows is no property of a rig, so the largest is left out; the sum is then compared with a
    chi-squared that is larger than its own distribution.

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
    normal, coordinates = model.normal, model.coordinates
    experiments = len(normal.square)
    if experiments < _FEWEST:
        return False
    z = coordinates.of(model.values)
    for key in (k for k, _ in candidate.sizes if k in inner):
        i, own = inner.index(key), model.names.index(key)
        information = np.maximum(normal.information[:, i, i], 1e-300)
        each = normal.gradient[:, i] ** 2 / information
        square, free = float(each.sum() - each.max()), experiments - 2
        # what size the effect has, over the standard error of that
        whole = float(information.sum()) * (1.0 if coordinates.log[own] else float(z[own])) ** 2
        if chi2.sf(square, free) <= level and square - free > model.bench.settings.one_size * whole:
            return True
    return False

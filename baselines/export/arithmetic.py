r"""Networks in an arithmetic that is the same to the last bit wherever IEEE double precision is.

A matrix product of a library sums in an order of its own and may fuse operations, and every library has its own tanh, so two of
them differ in the last bits. An exported network is therefore written with additions, multiplications and divisions alone, in one
order: the bias first, then the inputs from the first to the last. The functions here do the same operations in numpy; C99
(compiled without contraction, which is what ``-std=c99`` asks for) and MATLAB give the same bits.

The hyperbolic tangent is :math:`\tanh a = -m/(2 + m)` with :math:`m = e^{-2a} - 1` for :math:`a \ge 0`. With
:math:`-2a = k \ln 2 + r`, :math:`|r| \le \tfrac12 \ln 2`,

.. math:: m = (2^k - 1) + 2^k (e^r - 1) ,

where :math:`e^r - 1` is its Taylor polynomial of degree 13, which leaves 1e-17 of it. ``python -m benchmarks export`` prints how
far it is from the library's tanh.
"""

from __future__ import annotations

from math import factorial

import numpy as np
import numpy.typing as npt

from baselines.rl.agents import Agent
from flexdrive_gym.recording import FloatArray

# ln 2 in two parts: products of the first with small whole numbers are exact (fdlibm, e_exp.c)
LN2_HIGH, LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10
PER_LN2 = 1.44269504088896338700e00
# beyond, 1 - tanh is less than half of the last bit
LARGEST = 20.0
COEFFICIENTS = tuple(1.0 / factorial(n) for n in range(13, 1, -1))


def tanh(x: npt.ArrayLike) -> FloatArray:
    """Return the hyperbolic tangent, of the shape of ``x``."""
    values = np.asarray(x, dtype=np.float64)
    a = np.minimum(np.abs(values), LARGEST)
    y = -2.0 * a
    k = np.floor(y * PER_LN2 + 0.5)
    r = (y - k * LN2_HIGH) - k * LN2_LOW
    q = np.zeros_like(r)
    for c in COEFFICIENTS:
        q = q * r + c
    s = np.ldexp(1.0, k.astype(np.int64))
    m = (s - 1.0) + s * (r + r * r * q)
    t = -m / (2.0 + m)
    return np.asarray(np.where(values < 0.0, -t, t))


def network(agent: Agent, observations: npt.ArrayLike) -> FloatArray:
    """Return what an agent's network gives, before it is clipped to an action, as its exports compute it.

    Parameters
    ----------
    agent
        A trained policy.
    observations : array_like, shape (n, history * entries)
        Each row the last observations, newest first.

    Returns
    -------
    ndarray, shape (n,)
    """
    x = np.asarray(observations, dtype=np.float64).T
    for i, (W, b) in enumerate(agent.layers):
        weights, bias = np.asarray(W), np.asarray(b)
        z = np.repeat(bias[:, None], x.shape[1], axis=1)
        for j in range(len(x)):
            z = z + weights[:, j : j + 1] * x[j]
        if i + 1 < len(agent.layers):
            z = tanh(z) if agent.activation == "tanh" else np.maximum(z, 0.0)
        x = z
    return np.asarray(x[0])

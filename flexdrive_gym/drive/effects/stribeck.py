r"""The Stribeck effect: friction falls from its level at rest as a lubricating film builds up.

.. math:: d(v) = d + d_s\,e^{-(v/v_s)^2}, \qquad d_s = F_s - F_c .

The level at v = 0, which has to be overcome from rest, is :math:`d + d_s`, so the law is continuous where the cart
tears loose. Worked check: with d = 0.357 V, :math:`d_s` = 0.05 V and :math:`v_s` = 40 mm/s a cart tears loose at
0.407 V, slides against 0.375 V at 40 mm/s and against 0.357 V at 150 mm/s.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from flexdrive_gym.drive.effects._effect import Effect, Parameter
from flexdrive_gym.drive.simd.pack import anywhere, chosen

_GONE = 6.5


def _friction(d: float, x: float, v: float, s: float, fs: float, t: float, p: Any, o: int) -> float:
    if p[o] == 0.0:
        return d
    ratio = v / p[o + 1]
    # beyond, nothing of the peak is left in double precision
    near = abs(ratio) < _GONE
    return chosen(near, d + p[o] * np.exp(-ratio * ratio), d) if anywhere(near) else d


EFFECT = Effect(
    id="stribeck",
    where=("cart_1", "cart_2"),
    equation="d ← d + extra·exp(-(v/vs)²)",
    parameters=(
        Parameter("extra", "V", 0.0, 0.0, 4.0, "level at rest over the kinetic one, Fs - Fc", (0.05, 0.15)),
        Parameter("vs", "mm/s", 40.0, 1.0, 500.0, "Stribeck velocity", (15.0, 40.0, 100.0), role="shape"),
    ),
    hooks={"friction": _friction},
    tells_itself_by="force peak at low speed, reversals",
    looks_like=("presliding", "quadratic_drag"),
    separating_experiment="plateaus at ±0.7…1 V and at ±3 V",
    reference="R. Stribeck, VDI-Zeitschrift 46, 1902; B. Armstrong-Hélouvry et al., Automatica 30(7), 1994",
    order=3,
)

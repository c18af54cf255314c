r"""Presliding: before a contact slides its asperities bend like bristles, and friction is a spring with hysteresis.

Dahl's bristle of deflection :math:`\zeta` [mm], :math:`|\zeta| \le x_s`, in parallel with what is left of the Coulomb
level:

.. math:: \dot\zeta = v\,(1 - \operatorname{sgn}(v)\,\zeta/x_s), \qquad F = -f_d\,\zeta/x_s .

Along the way :math:`d\zeta/dx = 1 - s\,\zeta/x_s` does not contain time: while the cart slides in direction s,

.. math:: \zeta(\Delta x) = s x_s + (\zeta_0 - s x_s)\,e^{-s\,\Delta x/x_s} .

The step evaluates this closed form instead of integrating :math:`\dot\zeta`, whose rate :math:`|v|/x_s` reaches
10⁴/s: it is stable at every speed, and a reversal, where the force does change, begins at v = 0 and is well resolved.
Pure presliding is d = 0. Worked check: a small displacement Δx from rest pulls back with :math:`(f_d/x_s)\,\Delta x`;
with :math:`f_d` = 0.1 V and :math:`x_s` = 0.5 mm the force is 63 % of 0.1 V after 0.5 mm.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from flexdrive_gym.drive.compilation import inlined
from flexdrive_gym.drive.effects._effect import Effect, Parameter
from flexdrive_gym.drive.simd.pack import anywhere, chosen

_SETTLED = 1e-12
_SMALL = 0.25
_PER_6, _PER_24, _PER_120, _PER_720, _PER_5040 = 1.0 / 6.0, 1.0 / 24.0, 1.0 / 120.0, 1.0 / 720.0, 1.0 / 5040.0
_PER_40320, _PER_362880, _PER_3628800 = 1.0 / 40320.0, 1.0 / 362880.0, 1.0 / 3628800.0


@inlined
def _decay(a: float) -> float:
    """Return e^a; what is bent hardly any further within a step, which is the rule, needs no call of the library for it."""
    # the series up to a^10 leaves 6e-15
    b = a * a
    c = b * b
    first, second = (1.0 + a) + b * (0.5 + a * _PER_6), _PER_24 + a * _PER_120 + b * (_PER_720 + a * _PER_5040)
    hardly = first + c * (second + c * (_PER_40320 + a * _PER_362880 + b * _PER_3628800))
    much = abs(a) > _SMALL
    return chosen(much, np.exp(a), hardly) if anywhere(much) else hardly


@inlined
def _bristle(bent: float, dx: float, s: float, xs: float) -> float:
    """Return the bristle's deflection after a way, in units of the longest."""
    # neither a cart at rest nor a bristle that is bent as far as it goes moves on
    moves = (s != 0.0) & (dx != 0.0) & (abs(bent - s) >= _SETTLED)
    if not anywhere(moves):
        return bent
    return chosen(moves, s + (bent - s) * _decay(-s * dx / xs), bent)


def _cart(f: float, x: float, v: float, s: float, dx: float, t: float, z: Any, oz: int, p: Any, o: int) -> float:
    if p[o] == 0.0:
        return f
    return f - p[o] * _bristle(z[oz], dx, s, p[o + 1])


def _finish(w: int, dx: float, s: float, u: float, dt: float, z: Any, oz: int, p: Any, o: int) -> int:
    if p[o] != 0.0:
        z[oz] = _bristle(z[oz], dx, s, p[o + 1])
    return w


def _begin(w: int, v: float, v1: float, v2: float, u: float, z: Any, oz: int, p: Any, o: int) -> int:
    # a cart that is already sliding has its bristles bent
    z[oz] = chosen(v > 0.0, 1.0, chosen(v < 0.0, -1.0, 0.0))
    return w


EFFECT = Effect(
    id="presliding",
    where=("cart_1", "cart_2"),
    equation="F = -fd·ζ/xs,  dζ/dt = v·(1 - sgn(v)·ζ/xs)",
    parameters=(
        Parameter("fd", "V", 0.0, 0.0, 8.0, "level of the bristles", (0.1, 0.3)),
        Parameter("xs", "mm", 0.3, 0.001, 5.0, "presliding length", (0.05, 0.3, 1.5), role="shape"),
    ),
    hooks={"cart": _cart, "finish": _finish, "begin": _begin},
    memory=1,
    tells_itself_by="spring-like at each reversal",
    looks_like=("stribeck", "encoder_play"),
    separating_experiment="slow reversals of a few counts: presliding comes back elastically",
    reference=(
        "P. R. Dahl, A solid friction model, Aerospace Corp. TOR-0158, 1968; "
        "C. Canudas de Wit et al., IEEE Trans. Automatic Control 40(3), 1995"
    ),
)

r"""A rail that is not level: a constant force on each cart in proportion to its mass.

.. math:: F_1 = F\,\frac{m_1}{m_1+m_2}, \qquad F_2 = F\,\frac{m_2}{m_1+m_2} .

Worked check: F is the force that holds both carts; a rail tilted by 1 mm/m pulls with 9.81 mm/s² · (m1 + m2) = 0.011
V for m1 + m2 = 1.1e-3 V s²/mm.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.effects._effect import Effect, Parameter


def _cart_1(f: float, x: float, v: float, s: float, dx: float, t: float, z: Any, oz: int, p: Any, o: int) -> float:
    # p[0] and p[1] are 1/m1 and 1/m2; 1/m2 = 0 is a drive of one cart
    return f + (p[o] * p[1] / (p[0] + p[1]) if p[1] > 0.0 else p[o])


def _cart_2(f: float, x: float, v: float, s: float, dx: float, t: float, z: Any, oz: int, p: Any, o: int) -> float:
    return f + p[o] * p[0] / (p[0] + p[1])


EFFECT = Effect(
    id="tilt",
    where=("guide",),
    equation="F1 = F·m1/(m1 + m2),  F2 = F·m2/(m1 + m2)",
    parameters=(Parameter("F", "V", 0.0, -4.0, 4.0, "force on both carts together", (0.03, -0.03)),),
    hooks={"cart:cart_1": _cart_1, "cart:cart_2": _cart_2},  # type: ignore[dict-item]
    tells_itself_by="the drift of an input offset while moving",
    looks_like=("input_offset",),
    separating_experiment="another start position; the amplifier off",
    reference="Newton's second law on an inclined plane",
)

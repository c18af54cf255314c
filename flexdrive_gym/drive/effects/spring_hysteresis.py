r"""Friction between coils: a spring that loses the same energy in every cycle, however slow it is (Bouc-Wen).

.. math:: F = F_h\,\zeta, \qquad
   x_s\,\dot\zeta = \dot\delta - \tfrac12 |\dot\delta|\,\zeta - \tfrac12 \dot\delta\,|\zeta| ,

with the sharpness n = 1. ζ depends on the path of δ alone, not on its speed. Worked check: on the first loading from
zero :math:`F = F_h (1 - e^{-\delta/x_s})`. After a reversal F falls along a straight line to zero over :math:`x_s`
and exponentially beyond, so the loss of a cycle between ±A, A ≫ :math:`x_s`, is :math:`F_h (4A - 5x_s)` at any speed.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.effects._effect import Effect, Parameter


def _spring(f: float, delta: float, rate: float, z: Any, oz: int, p: Any, o: int) -> float:
    if p[o] == 0.0:
        return f
    return f + p[o] * z[oz]


def _rates(
    w: int, x1: float, v1: float, x2: float, v2: float, u: float, a: float, t: float, z: Any, oz: int, p: Any, o: int
) -> int:
    if p[o] != 0.0:
        rate, zeta = v1 - v2, z[oz]
        z[oz + w] = (rate - 0.5 * abs(rate) * zeta - 0.5 * rate * abs(zeta)) / p[o + 1]
    return w


def _fastest_rate(values: tuple[float, ...], masses: tuple[float, float]) -> float:
    # deflections move at up to about 600 mm/s on such drives
    return 600.0 / values[1]


EFFECT = Effect(
    id="spring_hysteresis",
    where=("spring",),
    equation="F = level·ζ,  xs·dζ/dt = dδ/dt - ½·|dδ/dt|·ζ - ½·dδ/dt·|ζ|",
    parameters=(
        Parameter("level", "V", 0.0, 0.0, 4.0, "largest force of the hysteresis", (0.03, 0.1)),
        Parameter("xs", "mm", 2.0, 0.1, 50.0, "deflection over which it builds up", (0.5, 2.0, 8.0), role="shape"),
    ),
    hooks={"spring": _spring, "rates": _rates},
    states=("zeta",),
    fastest_rate=_fastest_rate,
    tells_itself_by="loss per cycle independent of frequency",
    looks_like=("spring_damping", "load_friction"),
    separating_experiment="sines at several frequencies and one amplitude of δ",
    reference="R. Bouc, 1967; Y.-K. Wen, Method for random vibration of hysteretic systems, J. Eng. Mech. Div. 102(2), 1976",
)

r"""An appendage: a mass on a spring of its own on a cart, or the inertia of the coupling spring.

With mass :math:`m_a` (in addition to m1 or m2), its frequency :math:`\omega_a` while the cart is held, and damping
ratio :math:`\zeta`; ρ is its position relative to the cart and :math:`v_a` its velocity:

.. math:: F_a = m_a(\omega_a^2 \rho + 2\zeta\omega_a (v_a - v)), \qquad m_a \dot v_a = -F_a, \qquad \dot\rho = v_a - v ,

and the cart feels :math:`+F_a`. Worked check: on a free mass m the appendage moves against it with
:math:`\omega_a\sqrt{1 + m_a/m}`: 12.6 Hz for 12 Hz and :math:`m_a` = 0.1 m.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from flexdrive_gym.drive.effects._effect import Effect, Parameter


def _cart_1(f: float, x: float, v: float, s: float, dx: float, t: float, z: Any, oz: int, p: Any, o: int) -> float:
    if p[o] == 0.0:
        return f
    w = 2.0 * np.pi * p[o + 2]
    return f + p[o] * (w * w * z[oz] + 2.0 * p[o + 3] * w * (z[oz + 1] - v))


def _cart_2(f: float, x: float, v: float, s: float, dx: float, t: float, z: Any, oz: int, p: Any, o: int) -> float:
    if p[o + 1] == 0.0:
        return f
    w = 2.0 * np.pi * p[o + 2]
    return f + p[o + 1] * (w * w * z[oz + 2] + 2.0 * p[o + 3] * w * (z[oz + 3] - v))


def _rates(
    w: int, x1: float, v1: float, x2: float, v2: float, u: float, a: float, t: float, z: Any, oz: int, p: Any, o: int
) -> int:
    wa = 2.0 * np.pi * p[o + 2]
    if p[o] != 0.0:
        rate = z[oz + 1] - v1
        z[oz + w], z[oz + 1 + w] = rate, -(wa * wa * z[oz] + 2.0 * p[o + 3] * wa * rate)
    if p[o + 1] != 0.0:
        rate = z[oz + 3] - v2
        z[oz + 2 + w], z[oz + 3 + w] = rate, -(wa * wa * z[oz + 2] + 2.0 * p[o + 3] * wa * rate)
    return w


def _begin(w: int, v: float, v1: float, v2: float, u: float, z: Any, oz: int, p: Any, o: int) -> int:
    z[oz + 1], z[oz + 3] = v1, v2
    return w


def _fastest_rate(values: tuple[float, ...], masses: tuple[float, float]) -> float:
    *appendages, frequency, zeta = values
    w = 2.0 * np.pi * frequency
    # against a free cart it is faster than on a held one, the more so the lighter the cart beside it
    heavier = 1.0 + max(a / m for a, m in zip(appendages, masses, strict=True))
    return w * max(1.5 * max(1.0, 2.0 * zeta), float(np.sqrt(heavier)), 2.0 * zeta * heavier)


# neighbours differ by a quarter, within the width of a resonance that is damped by a tenth
_GRID = (5.0, 6.3, 8.0, 10.0, 12.5, 16.0, 20.0, 25.0, 32.0, 40.0, 50.0)

EFFECT = Effect(
    id="extra_mode",
    where=("structure",),
    equation="F_a = m_a·(ω_a²·ρ + 2ζω_a·dρ/dt) on the cart,  m_a·dv_a/dt = -F_a",
    parameters=(
        Parameter("mass_1", "V s²/mm", 0.0, 0.0, 1.0, "appendage of cart 1, besides m1", (3e-5, 1e-4)),
        Parameter("mass_2", "V s²/mm", 0.0, 0.0, 1.0, "appendage of cart 2, besides m2", (3e-5, 1e-4)),
        Parameter("frequency", "Hz", 15.0, 1.0, 200.0, "its frequency on a held cart", _GRID, role="shape"),
        Parameter("zeta", "1", 0.02, 0.0, 1.0, "its damping ratio", (0.05,), role="shape"),
    ),
    hooks={"cart:cart_1": _cart_1, "cart:cart_2": _cart_2, "rates": _rates, "begin": _begin},  # type: ignore[dict-item]
    states=("rho_1", "v_1", "rho_2", "v_2"),
    fastest_rate=_fastest_rate,
    tells_itself_by="a second resonance above 5 Hz",
    looks_like=(),
    separating_experiment="a chirp to 60 Hz, or a fast step seen at the full rate",
    reference="J. P. Den Hartog, Mechanical Vibrations, 1934, ch. 3 (the dynamic absorber)",
)

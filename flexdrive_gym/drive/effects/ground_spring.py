"""What pulls the carts to a place on the track: an encoder cable, a bowed rail, a spring to the frame.

A cable hangs on cart 1 (kg, kg3); a bowed rail acts on both carts in proportion to their masses (kg and kg_2).
Both pull towards x = 0, which is where the run starts, or the track's zero in an anchored replay; opposite signs would be
a second spring between the carts. Worked
check: kg = 3e-4 V/mm pulls with 0.03 V at 100 mm.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.effects._effect import Effect, Parameter


def _cart_1(f: float, x: float, v: float, s: float, dx: float, t: float, z: Any, oz: int, p: Any, o: int) -> float:
    return f - (p[o] + p[o + 1] * x * x) * x


def _cart_2(f: float, x: float, v: float, s: float, dx: float, t: float, z: Any, oz: int, p: Any, o: int) -> float:
    return f - p[o + 2] * x


EFFECT = Effect(
    id="ground_spring",
    where=("guide",),
    equation="F1 = -kg·x1 - kg3·x1³,  F2 = -kg_2·x2",
    parameters=(
        Parameter("kg", "V/mm", 0.0, 0.0, 1.0, "spring from cart 1 to the frame", (1e-3, 3e-4)),
        Parameter("kg3", "V/mm³", 0.0, -1e-3, 1e-3, "its cubic part", (2e-8, -1e-8)),
        Parameter("kg_2", "V/mm", 0.0, 0.0, 1.0, "spring from cart 2 to the frame", (1e-3, 3e-4)),
    ),
    hooks={"cart:cart_1": _cart_1, "cart:cart_2": _cart_2},  # type: ignore[dict-item]
    tells_itself_by="pulls to the centre",
    looks_like=("viscous_asymmetry", "tilt"),
    separating_experiment="another start position",
    reference="A. Janot, M. Gautier, M. Brunot, Data set and reference models of EMPS, 2019 (a prismatic axis)",
)

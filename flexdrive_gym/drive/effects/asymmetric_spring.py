r"""A spring that pulls otherwise than it pushes.

.. math:: F = \frac{k_2 \delta^2}{1 + c |\delta|}

With c = 0 the stiffness :math:`k + 2 k_2 \delta` changes in proportion to the deflection. With c > 0 it changes no more where
:math:`|\delta|` is large against 1/c: the spring then has the stiffness :math:`k + k_2/c` on one side and :math:`k - k_2/c` on
the other. Worked check: with k = 0.095 V/mm and k2 = 5e-4 V/mm² the forces at ±10 mm are 1.00 V and -0.90 V; with c = 0.4/mm,
too, they are 0.96 V and -0.94 V.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.effects._effect import Effect, Parameter


def _spring(f: float, delta: float, rate: float, z: Any, oz: int, p: Any, o: int) -> float:
    return f + p[o] * delta * delta / (1.0 + p[o + 1] * abs(delta))


EFFECT = Effect(
    id="asymmetric_spring",
    where=("spring",),
    equation="F = k2·δ²/(1 + c·|δ|)",
    parameters=(
        Parameter("k2", "V/mm²", 0.0, -1e-1, 1e-1, "quadratic stiffness", (5e-4, -5e-4)),
        Parameter(
            "c", "1/mm", 0.0, 0.0, 10.0, "over one: deflection beyond which stiffness stays", (0.0, 0.3), role="shape"
        ),
    ),
    hooks={"spring": _spring},
    tells_itself_by="even harmonics near resonance",
    looks_like=("coulomb_asymmetry",),
    separating_experiment="sines near resonance and far below it: friction's even part stays, the spring's goes",
    reference="A. H. Nayfeh, D. T. Mook, Nonlinear Oscillations, 1979, ch. 2",
)

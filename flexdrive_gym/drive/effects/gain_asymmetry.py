"""An output stage with two halves: the gain is 1 + a for positive commands and 1 - a for negative ones.

Third in the actuator's order, after limit and dead zone. Worked check: with a = 0.02 a square of ±2 V acts like +2.04
and -1.96 V.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.effects._effect import Effect, Parameter


def _command(u: float, t: float, p: Any, o: int) -> float:
    return u + p[o] * abs(u)


EFFECT = Effect(
    id="gain_asymmetry",
    where=("actuator",),
    equation="u ← u·(1 + a·sgn u)",
    parameters=(Parameter("a", "1", 0.0, -0.5, 0.5, "half the relative difference of the gains", (0.02, -0.02)),),
    hooks={"command": _command},
    tells_itself_by="even harmonics in proportion to u",
    looks_like=("input_offset", "coulomb_asymmetry", "viscous_asymmetry"),
    separating_experiment="squares at several amplitudes: an offset stays, this grows",
    reference="P. Horowitz, W. Hill, The Art of Electronics (push-pull output stages)",
    order=2,
)

"""A constant added to the command at the amplifier's input: the zero of a converter.

After limit, dead zone and gain, before lag and delay. Worked check: u0 = 0.02 V on a square of ±2 V makes +2.02 and
-1.98 V, and a mean drift of about 0.02 V/(b1 + b2) = 1.6 mm/s.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.effects._effect import Effect, Parameter


def _command(u: float, t: float, p: Any, o: int) -> float:
    return u + p[o]


EFFECT = Effect(
    id="input_offset",
    where=("actuator",),
    equation="u ← u + u0",
    parameters=(Parameter("u0", "V", 0.0, -4.0, 4.0, "offset", (0.03, -0.03)),),
    hooks={"command": _command},
    tells_itself_by="constant drift",
    looks_like=("tilt", "coulomb_asymmetry", "gain_asymmetry"),
    separating_experiment="slow ramps from rest both ways; amplifier off tells it from tilt",
    reference="L. Ljung, System Identification, 2nd ed. 1999 (offsets)",
    order=4,
)

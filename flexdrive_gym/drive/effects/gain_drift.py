"""A motor and amplifier that heat up within a run: the gain is 1 + rate·t.

Copper gains 0.39 % of resistance per kelvin, magnets lose 0.1-0.2 % of flux. Worked check: rate = -0.004/s takes 3.2
% off in 8 s.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.effects._effect import Effect, Parameter


def _command(u: float, t: float, p: Any, o: int) -> float:
    return u * (1.0 + p[o] * t)


EFFECT = Effect(
    id="gain_drift",
    where=("actuator",),
    equation="u ← u·(1 + rate·t)",
    parameters=(Parameter("rate", "1/s", 0.0, -0.1, 0.1, "relative change per second", (0.005, -0.005)),),
    hooks={"command": _command},
    tells_itself_by="slow trend within a run",
    looks_like=("friction_drift",),
    separating_experiment="replicates before and after; a long run of one amplitude",
    reference="R. Krishnan, Electric Motor Drives, 2001 (temperature and machine parameters)",
    order=3,
)

"""An amplifier that ignores small commands: u - clip(u, ±uz).

Second in the actuator's order: limit, dead zone, gain, offset, then lag and delay. Worked check: with uz = 0.1 V a
command of 0.35 V acts like 0.25 V, and one of 2 V like 1.9 V: in steady motion that is d1 + 0.1 V, hence the
likeness.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.effects._effect import Effect, Parameter


def _command(u: float, t: float, p: Any, o: int) -> float:
    return u - min(max(u, -p[o]), p[o])


EFFECT = Effect(
    id="dead_zone",
    where=("actuator",),
    equation="u ← u - clip(u, ±uz)",
    parameters=(Parameter("uz", "V", 0.0, 0.0, 4.0, "half width", (0.06, 0.2)),),
    hooks={"command": _command},
    tells_itself_by="at small u, not at v = 0",
    looks_like=("coulomb_friction", "saturation", "breakaway"),
    separating_experiment="small sine riding on motion; d1 swallows 94 % of it elsewhere",
    reference="G. Tao, P. V. Kokotović, Adaptive Control of Systems with Actuator and Sensor Nonlinearities, 1996",
    order=1,
)

"""The command limit of the amplifier, hard."""

from __future__ import annotations

from math import inf
from typing import Any

from flexdrive_gym.drive.effects._effect import Effect, Parameter


def _command(u: float, t: float, p: Any, o: int) -> float:  # noqa: ARG001
    return min(max(u, -p[o]), p[o])


EFFECT = Effect(
    id="saturation",
    where=("actuator",),
    equation="u ← clip(u, ±u_max)",
    parameters=(Parameter("limit", "V", inf, 0.01, inf, "largest command that acts", (2.0, 4.0, 8.0)),),
    hooks={"command": _command},
    tells_itself_by="strong drives only; responses stop growing with u",
    looks_like=("dead_zone",),
    separating_experiment="squares at two large amplitudes",
    reference="the rig's command saturates at ±8 V",
    base=True,
)

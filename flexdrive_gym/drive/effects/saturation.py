r"""The command limit of the amplifier, hard or soft.

A hard limit is ``clip(u, ±u_max)``. Many output stages round the corner; with a softness :math:`\epsilon` in (0, 1]

.. math:: u \leftarrow u \left(1 + |u/u_{max}|^{1/\epsilon}\right)^{-\epsilon},

which is the hard limit as :math:`\epsilon \to 0`. Worked check: at u = u_max the hard limit passes u_max, the soft
one :math:`u_{max}\,2^{-\epsilon}`: 4.76 V of 8 V for :math:`\epsilon = 0.75`. Whatever its softness, the limit is
what a rig's record of u is clipped to.
"""

from __future__ import annotations

from math import inf
from typing import Any

from flexdrive_gym.drive.effects._effect import Effect, Parameter
from flexdrive_gym.drive.simd.pack import chosen


def _command(u: float, t: float, p: Any, o: int) -> float:
    if p[o + 1] == 0.0:
        return min(max(u, -p[o]), p[o])
    # the larger of command and limit is taken out of the power, which would overflow at a corner that is nearly sharp
    large = max(abs(u), p[o])
    small = min(abs(u), p[o])
    passed = small * (1.0 + (small / large) ** (1.0 / p[o + 1])) ** -p[o + 1]
    return chosen(u >= 0.0, passed, -passed)


EFFECT = Effect(
    id="saturation",
    where=("actuator",),
    equation="u ← clip(u, ±u_max); soft: u ← u·(1 + |u/u_max|^(1/ε))^(-ε)",
    parameters=(
        Parameter("limit", "V", inf, 0.01, inf, "largest command that acts", (2.0, 4.0, 8.0), role="shape"),
        Parameter("softness", "1", 0.0, 0.0, 1.0, "roundness ε of the limit", (0.25,), extended=True, finer=True),
    ),
    hooks={"command": _command},
    tells_itself_by="strong drives only; responses stop growing with u",
    looks_like=("dead_zone",),
    separating_experiment="squares at two large amplitudes",
    reference="the rig's command saturates at ±8 V",
    base=True,
)

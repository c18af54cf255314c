r"""A motor and amplifier that heat up within a run: the gain is 1 + rate·t.

Copper gains 0.39 % of resistance per kelvin, magnets lose 0.1-0.2 % of flux. What heats up settles where it loses as much heat as
it gets, with the rate r and 1/s seconds,

.. math:: u \leftarrow u \left(1 + r (1 - e^{-s t})/s\right) .

Worked check: rate = -0.004/s takes 3.2 % off in 8 s, and 1.1 % with s = 0.35/s.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from flexdrive_gym.drive.effects._effect import Effect, Parameter


def _command(u: float, t: float, p: Any, o: int) -> float:
    if p[o + 1] == 0.0:
        return u * (1.0 + p[o] * t)
    return u * (1.0 - p[o] * np.expm1(-p[o + 1] * t) / p[o + 1])


EFFECT = Effect(
    id="gain_drift",
    where=("actuator",),
    equation="u ← u·(1 + rate·(1 - e^(-s·t))/s); s = 0: u·(1 + rate·t)",
    parameters=(
        Parameter("rate", "1/s", 0.0, -0.1, 0.1, "relative change per second", (0.005, -0.005)),
        Parameter("s", "1/s", 0.0, 0.0, 10.0, "settling: one over the time constant", (0.2,), finer=True),
    ),
    hooks={"command": _command},
    tells_itself_by="slow trend within a run",
    looks_like=("friction_drift",),
    separating_experiment="replicates before and after; a long run of one amplitude",
    reference="R. Krishnan, Electric Motor Drives, 2001 (temperature and machine parameters)",
    order=3,
)

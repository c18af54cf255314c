r"""A current loop that follows its command with a time constant: :math:`\tau\,\dot u_a = u - u_a`.

Under a command that is held over the piece the lag is known in closed form, :math:`u_a(\Delta t) = u + (u_{a0} -
u)\,e^{-\Delta t/\tau}`, so it is evaluated exactly however short it is. Last in the actuator's order. Worked check: 2
ms after a step of 1 V a lag of 2 ms has passed 0.632 V; far below 1/τ it is a delay of 2 ms.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from flexdrive_gym.drive.effects._effect import Effect, Parameter


def _actuator(u: float, dt: float, z: Any, oz: int, p: Any, o: int) -> float:
    if p[o] == 0.0:
        return u
    return u + (z[oz] - u) * np.exp(-dt / p[o])


def _finish(w: int, dx: float, s: float, u: float, dt: float, z: Any, oz: int, p: Any, o: int) -> int:
    if p[o] != 0.0:
        z[oz] = u + (z[oz] - u) * np.exp(-dt / p[o])
    return w


def _begin(w: int, v: float, v1: float, v2: float, u: float, z: Any, oz: int, p: Any, o: int) -> int:
    z[oz] = u
    return w


def _fastest_rate(values: tuple[float, ...], masses: tuple[float, float]) -> float:
    # the force is exact, its effect on the carts is integrated; lags below 0.2 ms need no finer steps, their impulse is tiny
    return min(1.0 / values[0], 5e3) if values[0] > 0.0 else 0.0


EFFECT = Effect(
    id="amplifier_lag",
    where=("actuator",),
    equation="τ·du/dt = u_cmd - u",
    parameters=(Parameter("tau", "s", 0.0, 0.0, 0.5, "time constant", (0.002, 0.006)),),
    hooks={"actuator": _actuator, "finish": _finish, "begin": _begin},
    memory=1,
    fastest_rate=_fastest_rate,
    tells_itself_by="phase and roll-off",
    looks_like=("input_delay", "encoder_delay"),
    separating_experiment="a 20-40 Hz sine or a fast step",
    reference="R. Krishnan, Electric Motor Drives, 2001 (current loop)",
)

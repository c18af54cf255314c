"""An encoder channel that arrives late: y(t - τ), on one channel only.

The reading of a fraction of a sample ago lies on the straight line between two samples; on a cart that accelerates
with a the line errs by less than a·h²/8 (0.4 µm at 3 m/s² and 1 ms). Before the start the cart is taken to have moved
with its initial velocity. Up to 61 samples are held. Worked check: 2 ms at 200 mm/s are 0.4 mm.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.effects._effect import RING, Effect, Parameter
from flexdrive_gym.drive.simd.pack import leading


def _reading(y: float, x: float, v: float, t: float, h: float, z: Any, oz: int, p: Any, o: int) -> float:
    if p[o] == 0.0:
        return y
    if t == 0.0:
        for i in range(RING):
            z[oz + 1 + i] = y - v * h * (RING - i)
        z[oz] = -1.0
    head = (int(leading(z[oz])) + 1) % RING
    z[oz] = head
    z[oz + 1 + head] = y
    # a delay that is whole up to round-off is whole
    whole = int(p[o] / h + 1e-9)
    part = max(p[o] / h - whole, 0.0)
    newer = z[oz + 1 + (head - whole) % RING]
    older = z[oz + 1 + (head - whole - 1) % RING]
    return newer + part * (older - newer)


EFFECT = Effect(
    id="encoder_delay",
    where=("encoder_1", "encoder_2"),
    equation="y ← y(t - τ)",
    parameters=(Parameter("tau", "s", 0.0, 0.0, 0.03, "delay of the channel", (0.002, 0.005)),),
    hooks={"reading": _reading},
    memory=1 + RING,
    tells_itself_by="phase of one channel only",
    looks_like=("amplifier_lag", "velocity_processing"),
    separating_experiment="a 20-40 Hz sine; x1 against x2 at slow constant acceleration",
    reference="L. Ljung, System Identification, 2nd ed. 1999 (delays)",
    order=4,
)

"""Friction that drifts within a run, as bearings warm up: d and b of a cart are scaled by 1 + rate·t.

t counts from the start of the run; the factor never falls below zero. Between runs friction may differ at will: that
is a nuisance per run of a fit, not a parameter of the drive. Worked check: rate = -0.01/s takes 8 % off in 8 s.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.effects._effect import Effect, Parameter


def _friction(d: float, x: float, v: float, s: float, fs: float, t: float, p: Any, o: int) -> float:
    return d * (1.0 + p[o] * t)


def _damping(b: float, v: float, s: float, t: float, p: Any, o: int) -> float:
    return b * (1.0 + p[o] * t)


EFFECT = Effect(
    id="friction_drift",
    where=("cart_1", "cart_2"),
    equation="d ← d·(1 + rate·t),  b ← b·(1 + rate·t)",
    parameters=(Parameter("rate", "1/s", 0.0, -1.0, 1.0, "relative change per second", (0.01, -0.01)),),
    hooks={"friction": _friction, "damping": _damping},
    tells_itself_by="replicates differ; periods within a run differ",
    looks_like=("gain_drift",),
    separating_experiment="replicates before and after",
    reference="B. Armstrong-Hélouvry, Control of Machines with Friction, 1991 (warm-up)",
    order=5,
)

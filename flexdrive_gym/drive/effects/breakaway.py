"""Static friction above kinetic: a cart at rest holds more than it feels while it slides.

``|F| ≤ d + extra`` at v = 0, and d as soon as it slides; in contrast to the Stribeck effect the surplus is gone at
once. Worked check: with d = 0.357 V and extra = 0.1 V a slowly rising command moves cart 1 at 0.457 V, and then
accelerates it with 0.1 V.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.effects._effect import Effect, Parameter


def _breakaway(d: float, x: float, s: float, fs: float, t: float, p: Any, o: int) -> float:
    return d + p[o]


EFFECT = Effect(
    id="breakaway",
    where=("cart_1", "cart_2"),
    equation="|F| ≤ d + extra at v = 0",
    parameters=(Parameter("extra", "V", 0.0, 0.0, 4.0, "static level over the kinetic one", (0.06, 0.15, 0.4)),),
    hooks={"breakaway": _breakaway},
    tells_itself_by="holds, then jumps",
    looks_like=("stribeck", "dead_zone"),
    separating_experiment="small sine riding on motion: a dead zone stays, a breakaway vanishes",
    reference="C. A. Coulomb, Théorie des machines simples, 1785; B. Armstrong-Hélouvry et al., Automatica 30(7), 1994",
)

"""Play between rack and encoder gear: the reading lags by a dead band ±g.

``y ← clip(y_prev, x - g, x + g)``: the reading stays until the rack has crossed the play. First in an encoder's
order; the encoder starts in the middle of its play. Worked check: after a reversal the reading is frozen for 2g; with
g = 0.2 mm that is 0.4 mm.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.effects._effect import Effect, Parameter


def _reading(y: float, x: float, v: float, t: float, h: float, z: Any, oz: int, p: Any, o: int) -> float:
    if p[o] == 0.0:
        return y
    if t == 0.0:
        z[oz] = y
    z[oz] = min(max(z[oz], y - p[o]), y + p[o])
    return z[oz]


EFFECT = Effect(
    id="encoder_play",
    where=("encoder_1", "encoder_2"),
    equation="y ← clip(y_prev, x - g, x + g)",
    parameters=(Parameter("g", "mm", 0.0, 0.0, 10.0, "half the play", (0.15, 0.5)),),
    hooks={"reading": _reading},
    memory=1,
    tells_itself_by="reading frozen at small motion and at reversals while the other cart moves",
    looks_like=("breakaway", "presliding"),
    separating_experiment=(
        "small slow sines: behind play the reading stands while the other cart moves; friction holds both, "
        "and a base does not recoil when all is slow"
    ),
    reference="M. Nordin, P.-O. Gutman, Automatica 38(10), 2002 (play operator)",
    order=1,
)

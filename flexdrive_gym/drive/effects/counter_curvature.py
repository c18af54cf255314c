r"""A speed sensor whose reading is bent: a power of the speed, as of a pulse counter whose charge per pulse is not constant.

.. math:: r \leftarrow r\,(|r| / v_r)^e, \qquad v_r = 100\ \mathrm{mm/s}

With e = 0 it is a straight one, with e = 1 it shows the square; at 100 mm/s it is right whatever e is. Worked check: with
e = 0.2 a speed of 200 mm/s reads as 229.7 mm/s and 50 mm/s as 43.5 mm/s.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.effects._effect import Effect, Parameter

_REFERENCE = 100.0
# below it a reading is nothing, and no power of zero is taken
_LEAST = 1e-9


def _speed(r: float, p: Any, o: int) -> float:
    if p[o] == 0.0:
        return r
    return r * ((abs(r) + _LEAST) / _REFERENCE) ** p[o]


EFFECT = Effect(
    id="counter_curvature",
    where=("encoder_1", "encoder_2"),
    equation="r ← r·(|r|/100 mm/s)^e",
    parameters=(Parameter("e", "1", 0.0, -0.5, 1.5, "exponent beyond 1", (0.2, -0.1)),),
    hooks={"speed": _speed},
    tells_itself_by="the reading's steady level is bent over the command, its oscillations, too",
    looks_like=("quadratic_drag",),
    separating_experiment="a second sensor, or a speed that is known",
    reference="T. Wigren, M. Schoukens, Coupled electric drives data set and reference models, Uppsala 2017 (pulse counters)",
    order=1,
)

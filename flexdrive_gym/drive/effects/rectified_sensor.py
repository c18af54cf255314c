r"""A pulse counter that does not see the direction: the velocity reading loses its sign, and may be bent.

.. math:: v \leftarrow (1 - s)\,v + s\,|v|\,(|v| / v_r)^e, \qquad v_r = 100\ \mathrm{mm/s}

It acts on the rate of the readings, before any filter, because such a sensor counts pulses; a position that is read
keeps its sign. The share s is 1 for a pulse counter and 0 for an encoder; in between it is a mixture that no sensor
has, but along which a fit can search. A counter whose charge per pulse changes with their rate shows a power of the speed,
1 + e; at 100 mm/s it is right whatever e is. Worked check: -120 mm/s reads as +120 mm/s at share 1, as 0 at share 0.5; with
e = 0.2 a counter shows 200 mm/s as 229.7 mm/s and 50 mm/s as 43.5 mm/s.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.effects._effect import Effect, Parameter

_REFERENCE = 100.0
# below it a reading is nothing, and no power of zero is taken
_LEAST = 1e-9


def _speed(r: float, p: Any, o: int) -> float:
    counted = abs(r)
    if p[o + 1] != 0.0:
        counted = counted * ((counted + _LEAST) / _REFERENCE) ** p[o + 1]
    return r + p[o] * (counted - r)


EFFECT = Effect(
    id="rectified_sensor",
    where=("encoder_1", "encoder_2"),
    equation="v ← (1 - share)·v + share·|v|·(|v|/100 mm/s)^e",
    parameters=(
        Parameter("share", "1", 0.0, 0.0, 1.0, "1 where the sign is lost", (1.0,)),
        Parameter("e", "1", 0.0, -0.5, 1.5, "exponent of the counter beyond 1", (0.0, 0.5), role="shape"),
    ),
    hooks={"speed": _speed},
    tells_itself_by="the sign is lost: no negative velocity in the recording",
    looks_like=(),
    separating_experiment="drive both ways",
    reference="T. Wigren, M. Schoukens, Coupled electric drives data set and reference models, Uppsala 2017 (pulse counters)",
)

"""A pulse counter that does not see the direction: the velocity reading loses its sign.

It acts on the rate of the readings, before any filter, because such a sensor counts pulses; a position that is read
keeps its sign. The share is 1 for a pulse counter and 0 for an encoder; in between it is a mixture that no sensor
has, but along which a fit can search. Worked check: -120 mm/s reads as +120 mm/s at share 1, as 0 at share 0.5.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.effects._effect import Effect, Parameter


def _speed(r: float, p: Any, o: int) -> float:
    return r + p[o] * (abs(r) - r)


EFFECT = Effect(
    id="rectified_sensor",
    where=("encoder_1", "encoder_2"),
    equation="v ← (1 - share)·v + share·|v|",
    parameters=(Parameter("share", "1", 0.0, 0.0, 1.0, "1 where the sign is lost", (1.0,)),),
    hooks={"speed": _speed},
    tells_itself_by="the sign is lost: no negative velocity in the recording",
    looks_like=(),
    separating_experiment="drive both ways",
    reference="T. Wigren, M. Schoukens, Coupled electric drives data set and reference models, Uppsala 2017 (pulse counters)",
)

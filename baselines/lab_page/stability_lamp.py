"""The lamp: is the loop stable on the drive with all its effects, and why, in a sentence.

The verdict is that of ``flexdrive stability`` (:mod:`baselines.loop_analysis.stability_limit`): the handout's first move,
then held, 12 s; unstable if the last cart swings more than 25 mm peak to peak within the last 6 s. One run decides it for
the gain at hand, so the lamp changes exactly at the drive's critical gain.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isfinite
from typing import Literal

import numpy as np

from baselines.lab_page import texts
from baselines.lab_page.loop_curves import Reading
from baselines.lab_page.motion import RIG_TIME_S
from flexdrive_gym import Drive, LinearController
from flexdrive_gym.drive.batch.closed_loop import run_batch
from flexdrive_gym.references import point_to_point

Level = Literal["stable", "held", "unstable", "unknown"]

_DURATION_S, _WINDOW_S, SWING_MM = 12.0, 6.0, 25.0
_NEAR = 1.1


@dataclass(frozen=True)
class Lamp:
    """The verdict.

    Attributes
    ----------
    level
        ``stable``: linear theory and simulation agree; ``held``: only friction holds it, or the limit is near; ``unstable``.
    sentence
        Why.
    """

    level: Level
    sentence: str


def swing(drive: Drive, controller: LinearController, factor: float) -> float:
    """Return the last cart's swing over the last 6 s of the trial [mm]; inf where the motion leaves all bounds."""
    xr = point_to_point(np.arange(round(_DURATION_S / RIG_TIME_S)) * RIG_TIME_S)
    out = run_batch([drive], xr, controller, gains=factor, true_states=False, sample_time=RIG_TIME_S)
    last = out[0, drive.carts - 1, -round(_WINDOW_S / RIG_TIME_S) :]
    return float(np.ptp(last)) if np.isfinite(last).all() else inf


def lamp(
    drive: Drive, controller: LinearController, factor: float, found: Reading, grows: float | None, unit: str
) -> Lamp:
    """Judge a loop.

    Parameters
    ----------
    drive
        With all its effects.
    controller, factor
        The law and what its command is multiplied with.
    found
        Of the linear loop at that factor.
    grows
        Smallest vibration that grows by harmonic balance [mm]; ``None`` where none does or it is not known yet.
    unit
        Of the gain that the slider shows; empty for a factor.
    """
    units, size = drive.units, swing(drive, controller, factor)

    def length(value: float) -> str:
        return units.text(value, "mm", 2)

    friction = units.text(drive["d1"] + (drive["d2"] if drive.carts == 2 else 0.0), "V", 2)
    known, times = isfinite(found.gain_margin), found.gain_margin
    limit = units.text(factor * times, "V/mm", 3) if unit and known else ""
    if size > SWING_MM:
        how = texts.SWINGS.format(swing=length(size)) if isfinite(size) else texts.LEAVES
        why = texts.UNSTABLE_ALTHOUGH
        if not found.stable and known:
            why = texts.UNSTABLE_LINEAR.format(limit=limit) if unit else texts.UNSTABLE_FACTOR.format(times=times)
        return Lamp("unstable", f"{texts.UNSTABLE} {how} {why}")
    if not found.stable:
        words = texts.HELD if unit else texts.HELD_FACTOR
        push = texts.HELD_PUSH.format(amplitude=length(grows)) if grows is not None else texts.HELD_ANY
        return Lamp("held", words.format(limit=limit or "–", friction=friction, times=times) + " " + push)
    if not known:
        return Lamp("stable", texts.STABLE_ALWAYS)
    margin = (texts.STABLE_MARGIN if unit else texts.STABLE_FACTOR).format(limit=limit, times=times)
    phase = texts.STABLE_PHASE.format(pm=found.phase_margin_deg) if isfinite(found.crossover) else "."
    if times < _NEAR:
        return Lamp("held", f"{texts.NEAR} {margin}{phase}")
    return Lamp("stable", f"{texts.STABLE} {margin}{phase}")

"""Figures of a drive that can be checked on the rig, before and after physics was named."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi

import numpy as np

from baselines.experiments import STABLE_GAIN, limit_in_the_lab
from baselines.stability_limit import (
    Feedback,
    ObservedLimit,
    critical_gain,
    linear_critical_gain,
    observed_limit,
    with_rig,
)
from flexdrive_gym import Drive, PControl, Recording
from flexdrive_gym.references import STROKE_MM
from identification.mismatch.verdict import Diagnosis, Prediction

_SETTLED_S, _MEAN_S = 6.0, 0.5


def predictions(diagnosis: Diagnosis, recordings: Sequence[Recording] = ()) -> tuple[Prediction, ...]:
    """Return what the free fit and the diagnosed drive predict.

    Parameters
    ----------
    recordings
        P-control runs among them tell what the rig did; default: those of the diagnosis.
    """
    split = diagnosis.split
    seen = observed_limit(recordings or (*split.learn, *split.prove, *split.loops))
    before, after = _figures(diagnosis.free), _figures(diagnosis.drive)
    return tuple(
        Prediction(name, value, after[name][0], unit, _words(seen) if name == _LAB else "")
        for name, (value, unit) in before.items()
    )


_LAB = "gain from x2 at which the lab's trajectory grows"


def _figures(drive: Drive) -> dict[str, tuple[float | None, str]]:
    feedback: Feedback = "x2" if drive.carts == 2 else "x1"
    found: dict[str, tuple[float | None, str]] = {}
    if drive.carts == 2:
        found["critical gain from x2, linear"] = (linear_critical_gain(drive, "x2"), "V/mm")
        found["critical gain from x2, simulated"] = (critical_gain(drive, "x2"), "V/mm")
        found[_LAB] = (limit_in_the_lab(drive), "V/mm")
        vibrates = drive.linear.omega_d > 0.0
        found["resonance frequency"] = (drive.linear.omega_n / (2.0 * pi) if vibrates else None, "Hz")
        found["damping ratio"] = (drive.linear.zeta if vibrates else None, "–")
    name = f"error of {feedback} after a {STROKE_MM:g} mm step at Kp = {STABLE_GAIN:g} V/mm"
    found[name] = (settled_error(drive, feedback), "mm")
    return found


def settled_error(drive: Drive, feedback: Feedback = "x2", gain: float = STABLE_GAIN) -> float:
    """Return xr - x that P-control leaves after a step of 50 mm, mean over the last half second of six [mm]."""
    t = np.arange(round(_SETTLED_S / 1e-3)) * 1e-3
    run = with_rig(drive).simulate_closed_loop(t, np.full(len(t), STROKE_MM), PControl(gain, feedback))
    x = run.x1 if feedback == "x1" else run.x2
    assert x is not None
    return float(STROKE_MM - np.mean(x[-round(_MEAN_S / 1e-3) :]))


def _words(seen: ObservedLimit) -> str:
    parts = []
    if seen.holds is not None:
        parts.append(f"{seen.holds:.4g} held" + (" (largest tried)" if seen.grows is None else ""))
    if seen.grows is not None:
        parts.append(f"{seen.grows:.4g} grew")
    return ", ".join(parts)

"""Figures of a drive that can be checked on the rig, before and after physics was named."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from baselines.lab.experiments import STABLE_GAIN
from baselines.lab.uncertainty import figures, settled_error
from baselines.loop_analysis.stability_limit import Feedback, ObservedLimit, observed_limit
from flexdrive_gym import Drive, Recording
from flexdrive_gym.references import STROKE_MM
from identification.mismatch.verdict import Diagnosis, Prediction


def predictions(diagnosis: Diagnosis, recordings: Sequence[Recording] = ()) -> tuple[Prediction, ...]:
    """Return what the free fit and the diagnosed drive predict.

    Parameters
    ----------
    recordings
        P-control runs among them tell what the rig did; default: those of the diagnosis.
    """
    split = diagnosis.split
    seen = observed_limit(recordings or (*split.learn, *split.prove, *split.loops))
    before, after = _values(diagnosis.free), _values(diagnosis.drive)
    return tuple(
        Prediction(name, value, after[name][0], unit, _words(seen) if name == _LAB else "")
        for name, (value, unit) in before.items()
    )


_LAB = "gain from x2 at which the lab's trajectory grows"
_TITLES: Mapping[str, str] = {
    "critical_gain_x2_linear": "critical gain from x2, linear",
    "critical_gain_x2_simulated": "critical gain from x2, simulated",
    "critical_gain_x2_trajectory": _LAB,
    "resonance_hz": "resonance frequency",
    "damping_ratio": "damping ratio",
}


def _values(drive: Drive) -> dict[str, tuple[float | None, str]]:
    feedback: Feedback = "x2" if drive.carts == 2 else "x1"
    known = figures(drive)
    found = {title: (known[name].of(drive), known[name].unit) for name, title in _TITLES.items() if name in known}
    name = (
        f"error of {feedback} after a step of {drive.units.text(STROKE_MM, 'mm')} at "
        f"Kp = {drive.units.text(STABLE_GAIN, 'V/mm')}"
    )
    found[name] = (settled_error(drive, feedback), "mm")
    return {title: (value, "–" if unit == "1" else unit) for title, (value, unit) in found.items()}


def _words(seen: ObservedLimit) -> str:
    parts = []
    if seen.holds is not None:
        parts.append(f"{seen.holds:.4g} held" + (" (largest tried)" if seen.grows is None else ""))
    if seen.grows is not None:
        parts.append(f"{seen.grows:.4g} grew")
    return ", ".join(parts)

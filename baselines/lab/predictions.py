"""Figures of a drive that can be checked on the rig, before and after physics was named, with their intervals."""

from __future__ import annotations

from collections.abc import Sequence

from baselines.lab.lab_scale import on_lab_scale
from baselines.lab.uncertainty import DRAWS, Predicted, predict
from baselines.loop_analysis.stability_limit import ObservedLimit, observed_limit
from flexdrive_gym import Recording
from flexdrive_gym.units import Units
from identification.mismatch.answer.verdict import Diagnosis, Interval, Prediction

# what the lab's own P-control runs answer
ANSWERED = "critical_gain_x2_trajectory"


def predictions(
    diagnosis: Diagnosis,
    recordings: Sequence[Recording] = (),
    *,
    draws: int = DRAWS,
    seed: int = 0,
    threads: int | None = None,
) -> tuple[Prediction, ...]:
    """Return what the base model and the diagnosed drive predict of another run of the rig, in the rig's units.

    Parameters
    ----------
    recordings
        P-control runs among them tell what the rig did; default: those of the diagnosis.
    draws, seed, threads
        Of :func:`~baselines.lab.uncertainty.predict`.
    """
    split, drive = diagnosis.split, on_lab_scale(diagnosis.drive)
    units, recorded_in = drive.units, diagnosis.drive.units
    seen = observed_limit(recordings or (*split.estimation, *split.report, *split.loops))
    after = predict(drive, draws=draws, seed=seed, threads=threads)
    # without a finding both are one drive
    before = (
        predict(on_lab_scale(diagnosis.base), draws=draws, seed=seed, threads=threads) if diagnosis.findings else after
    )
    return tuple(
        _prediction(before[name].of_rig(units), p.of_rig(units), _words(seen, recorded_in) if name == ANSWERED else "")
        for name, p in after.items()
        if name in before
    )


def _prediction(before: Predicted, after: Predicted, measured: str) -> Prediction:
    return Prediction(
        after.name,
        Interval(before.value, before.ci95),
        Interval(after.value, after.ci95),
        "–" if after.unit == "1" else after.unit,
        measured,
        after.extrapolated,
    )


def _words(seen: ObservedLimit, units: Units) -> str:
    parts = []
    if seen.holds is not None:
        parts.append(f"{_gain(seen.holds, units)} held" + (" (largest tried)" if seen.grows is None else ""))
    if seen.grows is not None:
        parts.append(f"{_gain(seen.grows, units)} grew")
    return ", ".join(parts)


def _gain(gain: float, units: Units) -> str:
    return f"{gain / units.one('V/mm'):.4g}"

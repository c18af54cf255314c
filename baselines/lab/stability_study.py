"""Handout 2.1-2.4 on any drive, and why the limit found there is not Routh's."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from baselines.controllers.p_control import proportional
from baselines.lab.experiments import limit_in_the_lab, stability_experiments
from baselines.lab.uncertainty import DRAWS, Predicted, predict
from baselines.loop_analysis.limit_cycle import LimitCycle, limit_cycle_curve, simulated_limit
from baselines.loop_analysis.stability_limit import HANDOUT_GAIN, StabilityLimit, explain, stability_limit, with_rig
from flexdrive_gym import Drive, Recording

_AMPLITUDES_MM = np.geomspace(2.0, 80.0, 60)
_TRIED_MM = np.geomspace(3.0, 45.0, 10)


@dataclass(frozen=True, eq=False)
class StabilityStudy:
    """What the handout's students find by hand, and the theory beside it.

    Attributes
    ----------
    limits
        Feedback to limits: Routh, margins, simulated by the contract's rule.
    student, student_without_friction
        Largest gain from x2 at which four seconds of the trajectory do not grow, with the drive's friction and without
        [V/mm]; ``None`` where nothing grows below 10 V/mm, or for a rigid drive.
    runs, runs_without_friction
        Section of the handout (2.1 … 2.4) to recording.
    curve
        Critical gain over amplitude by harmonic balance; the factor is Kp [V/mm]. Empty for a rigid drive.
    tried
        Some points of harmonic balance, each with the Kp found by simulation [V/mm].
    explanation
        Why the limits differ, in sentences.
    predicted
        Every figure with the interval that the drive's uncertainty leaves, by name.
    """

    drive: Drive
    limits: Mapping[str, StabilityLimit]
    student: float | None
    student_without_friction: float | None
    runs: Mapping[str, Recording]
    runs_without_friction: Mapping[str, Recording]
    curve: tuple[LimitCycle, ...]
    tried: tuple[tuple[LimitCycle, float], ...]
    explanation: tuple[str, ...]
    predicted: Mapping[str, Predicted]

    @property
    def agreement(self) -> float | None:
        """Largest relative difference of harmonic balance and simulation for vibrations above 10 mm; ``None`` without such."""
        both = [abs(kp / s.factor - 1.0) for s, kp in self.tried if s.amplitude >= 10.0 and np.isfinite(kp)]
        return max(both) if both else None


def study_stability(drive: Drive, at_gain: float = HANDOUT_GAIN, draws: int = DRAWS) -> StabilityStudy:
    """Run 2.1-2.4 with and without friction, and explain the difference.

    Parameters
    ----------
    drive
        Encoder counts and command limit are the handout's where it has none.
    at_gain
        Kp at which the phase margin is stated [V/mm].
    draws
        Of the drive, for intervals; 0 for none.
    """
    rig = with_rig(drive)
    predicted = predict(drive, draws=draws)
    limits = {f: stability_limit(drive, f, at_gain) for f in ("x1", "x2")[: drive.carts]}  # type: ignore[arg-type]
    runs = stability_experiments(drive)
    if drive.carts == 1:
        return StabilityStudy(
            drive, limits, None, None, runs, {}, (), (), ("A rigid drive has no limit in linear theory.",), predicted
        )  # fmt: skip
    smooth = rig.replace({"d1": 0.0, "d2": 0.0}, name=f"{drive.name} without Coulomb friction")
    student, free = limit_in_the_lab(drive), limit_in_the_lab(smooth)
    unit = proportional(1.0, "x2")
    curve = limit_cycle_curve(rig, unit, _AMPLITUDES_MM, limit=rig.voltage_limit)
    starts = limit_cycle_curve(rig, unit, _TRIED_MM, limit=rig.voltage_limit)
    tried = tuple((s, simulated_limit(rig, unit, s)) for s in starts if np.isfinite(s.factor))
    smooth_runs = stability_experiments(smooth)
    study = StabilityStudy(drive, limits, student, free, runs, smooth_runs, tuple(curve), tried, (), predicted)
    return replace(study, explanation=_explanation(study))


def _explanation(study: StabilityStudy) -> tuple[str, ...]:
    drive, limit, units = study.drive, study.limits["x2"], study.drive.units
    said = [explain(drive, limit)]
    routh = limit.critical_gain_linear
    if routh is None:
        return tuple(said)
    if study.student is not None and study.student_without_friction is not None:
        said.append(
            "The critical gain found as in the lab, by raising Kp until the vibration grows within four seconds of the "
            f"trajectory, is {units.text(study.student, 'V/mm')} with friction and "
            f"{units.text(study.student_without_friction, 'V/mm')} on the same drive without it (Routh: "
            f"{units.text(routh, 'V/mm')})."
        )
    finite = [s for s in study.curve if np.isfinite(s.factor)]
    if finite and (drive["d1"] > 0.0 or drive["d2"] > 0.0):
        least = min(finite, key=lambda s: s.factor)
        small = finite[0]
        said.append(
            f"By harmonic balance a vibration of x2 keeps an amplitude of {units.text(small.amplitude, 'mm', 2)} at "
            f"Kp = {units.text(small.factor, 'V/mm', 3)}, and one of {units.text(least.amplitude, 'mm', 2)} at "
            f"{units.text(least.factor, 'V/mm', 3)}. At a gain in between there is one amplitude "
            "that is kept: smaller vibrations decay, larger ones grow."
        )
        if study.agreement is not None:
            said.append(
                f"For vibrations above {units.text(10.0, 'mm')} simulation and harmonic balance agree to "
                f"{study.agreement:.1%}. In smaller ones the carts stick in every cycle, so that the motion is no sine, as "
                "harmonic balance assumes."
            )
    said.append(
        "With feedback from x1, the zeros beside the complex poles keep the phase above -180°, so no gain is "
        "unstable in linear theory. In return x2 may be off by what the spring yields, which a loop on x1 does not measure."
    )
    return tuple(said)

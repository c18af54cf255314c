r"""The stability limit of P-control: by Routh, by margins, and on the simulated rig with friction.

Linear theory knows one critical gain. On a rig with Coulomb friction the limit depends on amplitude: friction takes
:math:`\tfrac{4}{\pi} d V` of power per velocity amplitude V out of the vibration, which acts like a viscous damper
:math:`\tfrac{4 d}{\pi V}` that fades as the vibration grows. Small vibrations therefore die out at gains at which the
linear loop is unstable, and the measured limit lies above Routh's.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from flexdrive_gym import Drive, PControl, Recording
from flexdrive_gym.drive import kernels, parameters
from flexdrive_gym.drive.default import HANDOUT_LIMIT_V, HANDOUT_QUANTUM_MM
from flexdrive_gym.drive.sample import WORK_SPACE
from flexdrive_gym.recording import FloatArray
from flexdrive_gym.references import point_to_point
from flexdrive_gym.units import measured_in

Feedback = Literal["x1", "x2"]

HANDOUT_GAIN = 0.05
LARGEST_GAIN = 10.0
_SMALLEST_GAIN = 1e-3
_SAMPLE_TIME_S = 1e-3
_DURATION_S = 12.0
_WINDOW_S = 6.0
_SWING_MM = 25.0
_PRECISION, _ROUGH = 2e-3, 1e-2


def with_rig(drive: Drive) -> Drive:
    """Return the drive with what its file does not say of sensors and amplifier.

    The lab's rig has the handout's encoder counts and command limit. Of another rig nothing is known but that the largest
    recorded command is within its limit.
    """
    defaults = {}
    if drive.units.lab:
        defaults = {f"encoder_quantisation.encoder_{i}.quantum": HANDOUT_QUANTUM_MM for i in range(1, drive.carts + 1)}
    reached = drive.recorded.u if drive.recorded is not None and not drive.units.lab else 0.0
    defaults["saturation.limit"] = reached or HANDOUT_LIMIT_V
    missing = {k: v for k, v in defaults.items() if k not in drive.values}
    if not missing:
        return drive
    return drive.replace(missing, intervals=drive.intervals, covariance=drive.covariance)


def swings(drive: Drive, gains: FloatArray, feedback: Feedback) -> FloatArray:
    """Return the swing of x2 (x1 for a rigid drive) over the last 6 s of 12 s, for every gain, in one kernel.

    The reference is the handout's first forward move of 50 mm, then held; 1 kHz; encoder counts; command limit.

    Parameters
    ----------
    gains : ndarray, shape (n,)
        Kp [V/mm].

    Returns
    -------
    ndarray, shape (n,)
        Peak to peak [mm]; inf where the motion leaves all bounds.
    """
    rig = with_rig(drive)
    xr = point_to_point(np.arange(round(_DURATION_S / _SAMPLE_TIME_S)) * _SAMPLE_TIME_S)
    swing = np.empty(len(gains))
    kernels.sweep_p_control(
        xr,
        np.ascontiguousarray(gains, dtype=np.float64),
        1 if feedback == "x1" else 2,
        round(_WINDOW_S / _SAMPLE_TIME_S),
        _SAMPLE_TIME_S,
        parameters.substeps(rig.values, _SAMPLE_TIME_S, _SAMPLE_TIME_S),
        np.zeros(WORK_SPACE),
        parameters.workspace(rig.values),
        rig.vector(),
        swing,
    )
    return swing


def critical_gain(drive: Drive, feedback: Feedback = "x2") -> float | None:
    """Return the gain at which the simulated rig becomes unstable.

    Unstable means that x2 swings more than 25 mm peak to peak within the last 6 of 12 s; the limit is bisected to
    0.2 %.

    Returns
    -------
    float or None
        Kp [V/mm]; ``None`` where no limit exists below 10 V/mm.
    """
    bracket = _bracket(drive, feedback, np.geomspace(_SMALLEST_GAIN, LARGEST_GAIN, 81))
    return None if bracket is None else _bisected(drive, feedback, *bracket, _PRECISION)


def critical_gain_near(drive: Drive, feedback: Feedback, guess: float | None) -> float | None:
    """Return :func:`critical_gain` of a drive much like one whose critical gain is known: to 1 %, in a sixth of the time.

    Parameters
    ----------
    guess
        Critical gain of the other drive [V/mm]; ``None`` where it has none.
    """
    # most such drives have no limit either, so the question is coarse
    scan = np.geomspace(HANDOUT_GAIN, LARGEST_GAIN, 8) if guess is None else guess * np.geomspace(0.6, 1.6, 9)
    bracket = _bracket(drive, feedback, scan)
    if bracket is None and guess is None:
        return None
    if bracket is None or bracket[0] == bracket[1]:
        return critical_gain(drive, feedback)
    return _bisected(drive, feedback, *bracket, _ROUGH)


def _bracket(drive: Drive, feedback: Feedback, scan: FloatArray) -> tuple[float, float] | None:
    """Return the gains of a scan between which the rig becomes unstable; its first twice where that is unstable already."""
    unstable = swings(drive, scan, feedback) > _SWING_MM
    if not unstable.any():
        return None
    first = int(np.argmax(unstable))
    return float(scan[max(first - 1, 0)]), float(scan[first])


def _bisected(drive: Drive, feedback: Feedback, low: float, high: float, precision: float) -> float:
    while high > low * (1.0 + precision):
        # eight gains a sweep cost little more than one and cut the bracket ninefold
        inner = np.geomspace(low, high, 10)[1:-1]
        hit = swings(drive, inner, feedback) > _SWING_MM
        j = int(np.argmax(hit)) if hit.any() else len(inner)
        low, high = (float(inner[j - 1]) if j else low), (float(inner[j]) if j < len(inner) else high)
    return math.sqrt(low * high)


def critical_motion(drive: Drive, gain: float, feedback: Feedback) -> Recording:
    """Return the motion by which :func:`critical_gain` judges a gain."""
    t = np.arange(round(_DURATION_S / _SAMPLE_TIME_S)) * _SAMPLE_TIME_S
    return with_rig(drive).simulate_closed_loop(t, point_to_point(t), PControl(gain, feedback))


@dataclass(frozen=True)
class StabilityLimit:
    """Limits of P-control for one feedback.

    Attributes
    ----------
    critical_gain_linear
        Routh's criterion [V/mm]; ``None`` where every gain up to 10 V/mm is stable.
    critical_gain_margin
        The same from python-control's gain margin.
    critical_gain_simulated
        On the simulated rig with all its effects.
    vibration
        Frequency at which the linear loop reaches its limit [rad/s].
    phase_margin_deg
        Of the linear loop at ``at_gain``; ``None`` where the loop gain never crosses 1.
    at_gain
        [V/mm]
    """

    critical_gain_linear: float | None = field(metadata=measured_in("V/mm"))
    critical_gain_margin: float | None = field(metadata=measured_in("V/mm"))
    critical_gain_simulated: float | None = field(metadata=measured_in("V/mm"))
    vibration: float | None = field(metadata=measured_in("rad/s"))
    phase_margin_deg: float | None
    at_gain: float = field(metadata=measured_in("V/mm"))


def _finite(value: float, upper: float = math.inf) -> float | None:
    return float(value) if math.isfinite(value) and value <= upper else None


def linear_critical_gain(drive: Drive, feedback: Feedback) -> float | None:
    """Return the gain at which the linear loop becomes unstable by Routh's criterion [V/mm]; None up to 10 V/mm."""
    return _finite(drive.linear.routh_critical_gain(feedback), LARGEST_GAIN)


def stability_limit(drive: Drive, feedback: Feedback, at_gain: float = HANDOUT_GAIN) -> StabilityLimit:
    """Return the limits of P-control from x1 or x2.

    Parameters
    ----------
    at_gain
        Kp at which the phase margin is stated [V/mm]; default: the handout's stable gain.
    """
    import control  # noqa: PLC0415  (costs a second; used here only)

    plant = drive.linear.transfer_function(feedback)
    gain_margin, _pm, crossing, _wc = control.margin(plant)
    _gm, phase_margin, _wg, _wp = control.margin(at_gain * plant)
    return StabilityLimit(
        critical_gain_linear=linear_critical_gain(drive, feedback),
        critical_gain_margin=_finite(float(gain_margin), LARGEST_GAIN),
        critical_gain_simulated=critical_gain(drive, feedback),
        vibration=_finite(float(crossing)) if _finite(float(gain_margin), LARGEST_GAIN) is not None else None,
        phase_margin_deg=_finite(float(phase_margin)),
        at_gain=at_gain,
    )


def explain(drive: Drive, x2: StabilityLimit) -> str:
    """Say in a sentence why the simulated limit differs from the linear one."""
    linear, simulated, units = x2.critical_gain_linear, x2.critical_gain_simulated, drive.units
    friction = drive["d1"] + (drive["d2"] if drive.carts == 2 else 0.0)
    if linear is None:
        return f"The linear loop is stable for every gain up to {units.text(LARGEST_GAIN, 'V/mm')}."
    if simulated is None:
        return (
            f"The linear loop is unstable above {units.text(linear, 'V/mm')}, but with {units.text(friction, 'V', 3)} of Coulomb "
            "friction and a limited command the vibration never grows."
        )
    change = 100.0 * (simulated / linear - 1.0)
    if abs(change) < 1.0:
        return f"Simulated and linear limit agree to {abs(change):.1f} %: friction hardly matters on this drive."
    if change > 0.0:
        return (
            f"Coulomb friction ({units.text(friction, 'V', 3)}) raises the limit by {change:.0f} %, from "
            f"{units.text(linear, 'V/mm')} to {units.text(simulated, 'V/mm')}. On a vibration of velocity amplitude V "
            "a friction d acts as a viscous damper 4d/(πV): the larger the "
            "vibration, the weaker the damping. The limit therefore depends on the amplitude, and after a larger disturbance "
            "the loop is unstable at a smaller gain."
        )
    return (
        f"The simulated limit lies {-change:.0f} % below the linear one ({units.text(simulated, 'V/mm')} against "
        f"{units.text(linear, 'V/mm')}): "
        "sampling and delays take phase that the linear model does not know."
    )


@dataclass(frozen=True)
class ObservedLimit:
    """What recorded P-control runs say about the limit.

    Attributes
    ----------
    holds
        Largest recorded gain from x2 at which the vibration did not grow [V/mm], or ``None``.
    grows
        Smallest at which it did [V/mm], or ``None``.
    """

    holds: float | None
    grows: float | None


def grows(recording: Recording) -> bool:
    """Whether a P-control run is unstable as a student judges it: "the response amplitude increases".

    The trajectory repeats every 2 s, so its own share of the error xr - x2 is alike in both halves of a recording;
    growth is a swing in the second half at least 1.4 times that of the first, and more than 25 mm. A vibration that has
    grown as far as it can is caught between the command limits instead: there for a twentieth of the second half.
    """
    if recording.xr is None or recording.x2 is None:
        return False
    error = recording.xr - recording.x2
    half = recording.n // 2
    first, second = float(np.ptp(error[:half])), float(np.ptp(error[half:]))
    if not second < math.inf:  # a simulation that left all bounds
        return True
    limit = recording.excitation.limit
    caught = limit is not None and float(np.mean(np.abs(recording.u[half:]) > 0.999 * limit)) > 0.05
    return second > _SWING_MM and (second > 1.4 * first or caught)


def observed_limit(recordings: Sequence[Recording]) -> ObservedLimit:
    """Bracket the critical gain by the non-collocated P-control runs among the recordings."""
    runs = [
        (r.excitation.gain, grows(r))
        for r in recordings
        if r.closed_loop and r.excitation.feedback == "x2" and r.excitation.gain is not None
    ]
    stable = [gain for gain, unstable in runs if not unstable]
    unstable_gains = [gain for gain, unstable in runs if unstable]
    return ObservedLimit(max(stable, default=None), min(unstable_gains, default=None))

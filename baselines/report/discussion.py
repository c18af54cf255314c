"""The handout's questions (3.5), answered from the numbers found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from baselines.evaluation.metrics import dwells
from baselines.loop_analysis.stability_limit import StabilityLimit, grows
from flexdrive_gym import Drive, Recording
from flexdrive_gym.drive.default import HANDOUT_LIMIT_V

if TYPE_CHECKING:
    from identification import Validation
    from identification.frequency_response import FrequencyTable


@dataclass(frozen=True)
class PControlMeasures:
    """One P-control run in numbers.

    Attributes
    ----------
    error_rms, error_peak
        Of e = xr - x2 [mm].
    dwell_error
        Mean |e| over the last tenth of a second of every dwell [mm].
    vibration
        Largest swing of x2 during a dwell, peak to peak [mm].
    unstable
        Whether the vibration grows.
    saturated
        Share of samples with the command at its limit.
    simulated
        Whether the run is a simulation, not a recording of a rig.
    """

    name: str
    feedback: str
    gain: float
    error_rms: float
    error_peak: float
    dwell_error: float
    vibration: float
    unstable: bool
    saturated: float
    simulated: bool = False


def measure_p_control(run: Recording) -> PControlMeasures:
    """Return the measures of a P-control run.

    Raises
    ------
    ValueError
        If the run has no reference or no second cart.
    """
    if run.xr is None or run.x2 is None:
        raise ValueError(f"{run.name}: needs xr and x2; record both (2.1).")
    e = run.xr - run.x2
    rests = dwells(run.xr, run.sample_time)
    tail = round(0.1 / run.sample_time)
    at_end = [float(np.mean(np.abs(e[max(d.begin, d.end - tail) : d.end]))) for d in rests]
    # the first part of a dwell still belongs to the arrival
    swing = [float(np.ptp(run.x2[d.middle : d.end])) for d in rests]
    limit = run.excitation.limit or HANDOUT_LIMIT_V
    return PControlMeasures(
        run.name,
        run.excitation.feedback or "?",
        run.excitation.gain or float("nan"),
        float(np.sqrt(np.mean(e**2))),
        float(np.max(np.abs(e))),
        float(np.mean(at_end)) if at_end else float("nan"),
        max(swing, default=float("nan")),
        grows(run),
        float(np.mean(np.abs(run.u) > 0.999 * limit)),
        run.source == "simulated",
    )


def effect_of_gain(measures: Sequence[PControlMeasures], drive: Drive, limit: StabilityLimit | None) -> list[str]:
    """Answer "What is the effect of changing the P-control gain in non-collocated control?"."""
    units = drive.units
    runs = sorted((m for m in measures if m.feedback == "x2"), key=lambda m: m.gain)
    if not runs:
        return ["There is no run with feedback from x2 to discuss."]
    answer = []
    low, calm = runs[0], [m for m in runs if not m.unstable]
    if len(calm) > 1:
        high = calm[-1]
        answer.append(
            f"Raising Kp from {units.text(low.gain, 'V/mm')} to {units.text(high.gain, 'V/mm')} stiffens the loop: "
            "the error left in the dwells falls "
            f"from {units.text(low.dwell_error, 'mm', 3)} to {units.text(high.dwell_error, 'mm', 3)}, because the "
            "command Kp·e of a P-controller no "
            f"longer moves the carts once it is below their friction (dT/Kp = "
            f"{units.text(_total_friction(drive) / low.gain, 'mm', 3)} against "
            f"{units.text(_total_friction(drive) / high.gain, 'mm', 3)})."
        )
        answer.append(
            f"In return the vibration is less damped: x2 still swings {units.text(high.vibration, 'mm', 3)} peak to "
            "peak in the dwells at "
            f"{units.text(high.gain, 'V/mm')}, against {units.text(low.vibration, 'mm', 3)} at "
            f"{units.text(low.gain, 'V/mm')}, since the loop excites the spring's "
            f"resonance (ωn = {drive.linear.omega_n:.1f} rad/s, ζ = {drive.linear.zeta:.2f}) with more than 180° of lag."
        )
    for m in runs:
        if m.unstable:
            touches = f", resting against the command limit {m.saturated:.0%} of the time" if m.saturated > 0.0 else ""
            answer.append(
                f"At {units.text(m.gain, 'V/mm')} the amplitude grows: |e| reaches {units.text(m.error_peak, 'mm', 3)}{touches}."
            )
    if limit is not None and limit.critical_gain_linear is not None:
        simulated = limit.critical_gain_simulated
        answer.append(
            f"The identified drive puts the limit at {units.text(limit.critical_gain_linear, 'V/mm')} without "
            "friction (Routh) and "
            + (f"at {units.text(simulated, 'V/mm')} with it." if simulated is not None else "finds none with friction.")
        )
    return answer


def collocation(measures: Sequence[PControlMeasures], drive: Drive) -> list[str]:
    """Answer what collocated control buys and costs against non-collocated control."""
    units = drive.units
    collocated = [m for m in measures if m.feedback == "x1"]
    if not collocated:
        return ["There is no run with feedback from x1 to discuss."]
    m = max(collocated, key=lambda item: item.gain)
    same = min((o for o in measures if o.feedback == "x2"), key=lambda o: abs(o.gain - m.gain), default=None)
    answer = [
        f"Advantage: stability. With feedback from x1 at {units.text(m.gain, 'V/mm')} the vibration "
        f"{'grows too' if m.unstable else 'does not grow'} (x2 swings {units.text(m.vibration, 'mm', 3)} in the dwells)"
        + (
            f", where feedback from x2 at {units.text(same.gain, 'V/mm')} {'was unstable' if same.unstable else 'held'} "
            f"({units.text(same.vibration, 'mm', 3)})."
            if same is not None
            else "."
        )
        + " The zeros beside the complex poles make up for the phase lag of the spring: in linear theory no gain is unstable."
    ]
    slack = f"±d2/k = ±{units.text(drive['d2'] / drive['k'], 'mm', 3)}" if drive["k"] > 0.0 else "any distance"
    rest = (
        f"{units.text(m.dwell_error, 'mm', 3)}"
        if np.isfinite(m.dwell_error)
        else "unknown, because the reference never rests"
    )
    answer.append(
        f"Disadvantage: accuracy of x2. The loop does not measure the spring's deflection, so x2 may rest anywhere within "
        f"{slack} of x1 and rings with the bare drive's damping; the "
        f"{'simulated' if m.simulated else 'measured'} error of x2 in the dwells is {rest}."
    )
    return answer


def time_domain_observations(validation: Validation, drive: Drive) -> list[str]:
    """State two observations on simulated against measured step responses (3.3)."""
    units = drive.units
    fits = [
        f
        for overlay in validation.overlays
        if overlay.measured.excitation.kind == "square"
        for f in overlay.fits
        if np.isfinite(f.rms)
    ]
    if not fits:
        return ["There is no step response to compare."]
    worst, best = max(fits, key=lambda f: f.rms), min(fits, key=lambda f: f.rms)
    ratio = [f.rms / f.floor for f in fits if np.isfinite(f.floor) and f.floor > 0.0]
    first = (
        f"The simulation follows {best.channel} best ({best.recording}: rms {units.text(best.rms, best.unit, 3)}, VAF "
        f"{best.vaf:.1%}) and "
        f"{worst.channel} worst ({worst.recording}: {units.text(worst.rms, worst.unit, 3)}, VAF {worst.vaf:.1%})."
    )
    second = (
        f"What remains is {np.median(ratio):.1f} times (median) what differs between one period and the next of the same "
        "run, " + ("so little is left to model." if np.median(ratio) < 1.2 else "so physics is missing from the model.")
        if ratio
        else "No period repeats, so there is no floor to compare the rest with."
    )
    oscillates = f" The simulated oscillation has ωd = {units.text(drive.linear.omega_d, 'rad/s', 3)}."
    third = (
        f"The residual is {'white' if min(f.whiteness for f in fits) > 0.01 else 'coloured'} in the Ljung-Box test; "
        f"in {sum(f.input_correlation > 1.0 for f in fits)} of {len(fits)} channels the command still explains part of it."
        + (oscillates if drive.carts == 2 else "")
    )
    return [first, second, third]


def frequency_domain_observations(table: FrequencyTable, drive: Drive, cart: int) -> list[str]:
    """State two observations on theoretical against measured frequency response (3.4)."""
    units = drive.units
    points = [(row.frequency, row.cart(cart)) for row in table.rows]
    clear = [(f, c.gain, c.phase_deg) for f, c in points if c is not None and c.phase_deg is not None]
    if not clear:
        return ["No sine response stands above the encoder's resolution."]
    f, gain, phase = np.array(clear, dtype=np.float64).T
    theory = drive.linear.frequency_response(2.0 * np.pi * f, "x1" if cart == 1 else "x2")
    ratio = gain / np.abs(theory)
    difference = np.angle(np.exp(1j * np.deg2rad(phase)) / (theory / np.abs(theory)), deg=True)
    low = f <= 1.0
    i = int(np.argmax(np.abs(np.log(ratio))))
    j = int(np.argmax(np.abs(difference)))
    first = (
        f"At low frequency (up to 1 Hz) the measured gain of cart {cart} is {np.mean(ratio[low]):.2f} times the linear one: "
        "dry friction takes a share of the drive that the linear model does not know."
        if low.any()
        else f"The measured gain of cart {cart} is {np.mean(ratio):.2f} times the linear one on average."
    )
    return [
        first,
        (
            f"The gain differs most at {units.text(f[i], 'Hz')} (factor {ratio[i]:.2f}) and the phase at "
            f"{units.text(f[j], 'Hz')} ({difference[j]:+.0f}°)."
        ),
    ]


def _total_friction(drive: Drive) -> float:
    return drive["d1"] + (drive["d2"] if drive.carts == 2 else 0.0)

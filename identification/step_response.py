r"""The handout's identification from two step responses (3.2), to the letter, with its known bias stated.

:func:`identify_by_handout` averages half-periods (:mod:`identification.half_periods`), takes the steps of the handout one
by one (:mod:`identification.handout_steps`, where the bias of the 63 % reading is derived), and returns the table of 3.5
with every reading, for plots and doubts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import pi

import numpy as np

from flexdrive_gym import Drive, Provenance, Recording, __version__
from flexdrive_gym.units import LAB, Units
from identification.half_periods import (
    STEADY_PART,
    AmplitudeReading,
    VibrationReading,
    read_amplitudes,
    read_vibration,
)
from identification.handout_steps import (
    TimeConstantReading,
    ZetaIteration,
    consistent_p,
    iterate_zeta,
    propagated,
    quantities_from,
    read_time_constant,
    steady_state_line,
    time_to_63_percent,
)
from identification.quantities import HANDOUT_RATIOS, UNITS, Quantity

__all__ = [
    "HandoutResult",
    "TimeConstantReading",
    "ZetaIteration",
    "identify_by_handout",
    "iterate_zeta",
    "time_to_63_percent",
]

_PARAMETERS = ("m1", "m2", "b1", "b2", "k", "C", "d1", "d2")
# the handout observes the vibration at this amplitude
_VIBRATION_AMPLITUDE = 1.5
# the jump lasts up to 15 ms on the handout's rig [s]
_SETTLED = 0.015


@dataclass(frozen=True, eq=False)
class HandoutResult:
    """The table of handout 3.5 and everything read on the way to it.

    Attributes
    ----------
    quantities
        Symbol to :class:`~identification.quantities.Quantity`, in the handout's order. Standard errors are those of
        the readings, not of the handout's assumptions.
    amplitudes
        Averaged half-periods per amplitude, those that do not move steadily included (``steady`` tells).
    time_constant
        The 63 % reading and its bias.
    vibration
        The reading of ωd.
    iterations
        The table of Steps 1-6.
    alpha, beta, gamma
        The ratios assumed.
    recordings
        Names of the runs used.
    notes
        What was left out, and what to doubt.
    """

    quantities: Mapping[str, Quantity]
    amplitudes: tuple[AmplitudeReading, ...]
    time_constant: TimeConstantReading
    vibration: VibrationReading
    iterations: tuple[ZetaIteration, ...]
    alpha: float
    beta: float
    gamma: float
    recordings: tuple[str, ...]
    notes: tuple[str, ...]
    units: Units = LAB

    @property
    def steady(self) -> tuple[AmplitudeReading, ...]:
        """The amplitudes used."""
        return tuple(reading for reading in self.amplitudes if reading.steady)

    def __getitem__(self, name: str) -> float:
        return self.quantities[name].value

    def drive(self, **more: float) -> Drive:
        """Return the identified drive.

        Parameters
        ----------
        **more
            Further parameters of the drive, for example ``**{"saturation.limit": 8.0}``.

        Returns
        -------
        Drive
            With provenance.
        """
        values = {name: self[name] for name in _PARAMETERS}
        provenance = Provenance("handout", self.recordings, __version__, f"p {self.quantities['p'].how}")
        return Drive({**values, **more}, provenance=provenance, name="handout 3.2", units=self.units)

    def __str__(self) -> str:
        ratios = f"α = {self.alpha:g}, β = {self.beta:g}, γ = {self.gamma:g}"
        lines = [f"Identification from step responses (handout 3.2): {ratios}", ""]
        lines.append(f"{'quantity':<9}{'value':>11}  {'std. error':>10}  {'unit':<8}  how")
        for name, figure in self.quantities.items():
            q = figure.of_rig(self.units)
            error = f"{q.standard_error:.2g}" if q.standard_error is not None else "-"
            lines.append(f"{name:<9}{q.value:>11.5g}  {error:>10}  {q.unit:<8}  {q.how}")
        lines += ["", *self._readings()]
        return "\n".join(lines + [f"note: {note}" for note in self.notes])

    def _readings(self) -> list[str]:
        lines = []
        units = self.units
        for a in self.amplitudes:
            error = "" if a.vss_error is None else f" ± {units.text(a.vss_error, 'mm/s', 2)}"
            used = f"vss = {units.text(a.vss, 'mm/s')}{error}" if a.steady else "does not move steadily, left out"
            lines.append(
                f"±{units.text(a.amplitude, 'V')}: {used} ({a.n_averaged} half-periods, runs: {len(a.recordings)})"
            )
        c = self.time_constant
        lines.append(
            f"63 % reading at ±{units.text(c.amplitude, 'V')}: t63 = {1e3 * c.t63:.3g} ms, p = {c.p_read:.4g} 1/s; corrected for "
            f"Coulomb friction p = {c.p_corrected:.4g} 1/s, so the reading is {c.bias_percent:.3g} % too large"
        )
        if c.p_consistent is not None:
            lines.append(
                f"the drive of 3.2, simulated with spring and friction, has this t63 at p = {c.p_consistent:.4g} 1/s: the "
                f"reading is {100.0 * (c.p_read / c.p_consistent - 1.0):.3g} % too large in all"
            )
        peaks = ", ".join(f"{t:.3f}" for t in self.vibration.peak_times)
        lines.append(f"extrema of v2 at ±{units.text(self.vibration.amplitude, 'V')}: t = {peaks} s")
        return lines


def identify_by_handout(
    recordings: Sequence[Recording],
    *,
    alpha: float = HANDOUT_RATIOS["alpha"],
    beta: float = HANDOUT_RATIOS["beta"],
    gamma: float = HANDOUT_RATIOS["gamma"],
    p: float | None = None,
) -> HandoutResult:
    """Identify the drive as handout 3.2 prescribes, from all square-wave runs.

    Parameters
    ----------
    recordings
        Runs; only square waves (``excitation.kind == "square"``) are used, of at least two amplitudes.
    alpha, beta, gamma
        The handout's assumed ratios m2/m1, b2/b1, d2/d1.
    p
        Real pole [1/s] to use instead of the one read (3.3's slight adjustment); the rest is recomputed.

    Returns
    -------
    HandoutResult
        Quantities of 3.5, readings and notes.

    Raises
    ------
    ValueError
        If a ratio or p is not positive, fewer than two amplitudes move steadily, bT or dT comes out negative, or the
        readings fail. The message says which amplitudes there were and what to do.
    """
    for name, value in (("alpha", alpha), ("beta", beta), ("gamma", gamma), ("p", p)):
        if value is not None and (not value > 0.0 or not np.isfinite(value)):
            raise ValueError(f"{name}: must be positive; got {value:g}. The handout has 0.54, 0.1, 0.1 and reads p.")
    units = recordings[0].units if recordings else LAB
    amplitudes = read_amplitudes(recordings, alpha)
    used = [reading for reading in amplitudes if reading.steady]
    _require_two(used, amplitudes, units)
    bT, dT, line_covariance = steady_state_line(used)
    notes = _notes_on_amplitudes(amplitudes, units)
    if dT < 0.0:
        notes.append(f"dT came out as {units.text(dT, 'V', 3)}, zero within its error; taken as 0")
        dT = 0.0
    time_constant = read_time_constant(used[-1], dT)
    vibration = read_vibration(_for_vibration(used), alpha)
    pole = time_constant.p_read if p is None else p

    def drive_for(pole: float) -> Drive:
        values, _ = quantities_from(np.array([bT, dT, pole, vibration.omega_d]), alpha, beta, gamma)
        return Drive({name: values[name] for name in _PARAMETERS})

    consistent = consistent_p(time_constant, bT, dT, drive_for, float(np.ptp(used[-1].t)))
    time_constant = replace(time_constant, p_consistent=consistent)
    readings = np.array([bT, dT, pole, vibration.omega_d])
    values, iterations = quantities_from(readings, alpha, beta, gamma)
    p_error = time_constant.p_error if p is None else 0.0
    errors = propagated(
        lambda x: quantities_from(x, alpha, beta, gamma)[0],
        readings,
        line_covariance,
        p_error,
        vibration.standard_error,
    )
    how = _how(used, time_constant, vibration, p, (alpha, beta, gamma), units)
    quantities = {name: Quantity(values[name], UNITS[name], how[name], errors[name]) for name in UNITS}
    notes += _notes_on_result(amplitudes, quantities, time_constant, vibration, iterations, units)
    return HandoutResult(
        quantities=quantities,
        amplitudes=amplitudes,
        time_constant=time_constant,
        vibration=vibration,
        iterations=iterations,
        alpha=alpha,
        beta=beta,
        gamma=gamma,
        recordings=tuple(name for reading in used for name in reading.recordings),
        notes=tuple(notes),
        units=units,
    )


def _require_two(used: Sequence[AmplitudeReading], amplitudes: Sequence[AmplitudeReading], units: Units) -> None:
    if len(used) >= 2:
        return
    have = (
        ", ".join(f"±{units.text(a.amplitude, 'V')}" + ("" if a.steady else " (stops)") for a in amplitudes) or "none"
    )
    two = "±1.5 V and ±2 V at 0.5 Hz" if units.lab else "two amplitudes"
    raise ValueError(
        "recordings: Eq. (5) needs square waves of at least two amplitudes at which the carts keep moving for two or more "
        f"reversals; got {have}. Record {two}, or larger amplitudes where the carts stop."
    )


def _for_vibration(used: Sequence[AmplitudeReading]) -> AmplitudeReading:
    """Return the reading at ±1.5 V, the handout's, or else the smallest amplitude that moves steadily."""
    exact = [reading for reading in used if abs(reading.amplitude - _VIBRATION_AMPLITUDE) < 0.05]
    return exact[0] if exact else used[0]


def _how(
    used: Sequence[AmplitudeReading],
    time_constant: TimeConstantReading,
    vibration: VibrationReading,
    p: float | None,
    ratios: tuple[float, float, float],
    units: Units,
) -> dict[str, str]:
    alpha, beta, gamma = ratios
    at = ", ".join(f"±{units.text(reading.amplitude, 'V')}" for reading in used)
    line = f"Eq. (5) at {at}" + (", least squares" if len(used) > 2 else "")
    read = f"63 % of v1's range at ±{units.text(time_constant.amplitude, 'V')}" if p is None else "given"
    steps = "Steps 1-6"
    return {
        "bT": line, "b1": f"bT/(1 + β), β = {beta:g}", "b2": "β·b1",
        "dT": line, "d1": f"dT/(1 + γ), γ = {gamma:g}", "d2": "γ·d1",
        "p": read, "mT": "bT/p, Eq. (6)", "m1": f"mT/(1 + α), α = {alpha:g}", "m2": "α·m1",
        "omega_d": f"{len(vibration.estimates)} intervals between extrema of v2 at ±{units.text(vibration.amplitude, 'V')}",
        "k": steps, "zeta": steps, "omega_n": steps, "C": "assumed",
    }  # fmt: skip


def _notes_on_amplitudes(amplitudes: Sequence[AmplitudeReading], units: Units) -> list[str]:
    notes = []
    for a in amplitudes:
        at = f"±{units.text(a.amplitude, 'V')}"
        total = a.n_stopped + (a.n_averaged if a.steady else a.n_averaged - a.n_stopped)
        if not a.steady:
            notes.append(
                f"{at}: does not move steadily, the carts stop in {a.n_stopped} of {total} half-periods; left out, since "
                "Eq. (5) holds for moving carts"
            )
        elif a.n_stopped:
            notes.append(f"{at}: half-periods left out because the carts stop: {a.n_stopped} of {total}")
        if a.n_faulty:
            notes.append(f"{at}: half-periods left out because of sensor faults: {a.n_faulty}")
    return notes


def _notes_on_result(
    amplitudes: Sequence[AmplitudeReading],
    quantities: Mapping[str, Quantity],
    time_constant: TimeConstantReading,
    vibration: VibrationReading,
    iterations: Sequence[ZetaIteration],
    units: Units,
) -> list[str]:
    notes = []
    bT, dT = quantities["bT"], quantities["dT"]
    if bT.standard_error is not None and bT.standard_error > 0.2 * bT.value:
        notes.append(
            f"bT is known to {100.0 * bT.standard_error / bT.value:.0f} % only: the steady velocities lie too close "
            "together for their spread; take amplitudes further apart"
        )
    stops = [a.amplitude for a in amplitudes if not a.steady and a.amplitude > 1.1 * dT.value]
    if stops:
        listed = ", ".join(f"±{units.text(a, 'V')}" for a in stops)
        notes.append(
            f"Eq. (5) says the carts move above dT = {units.text(dT.value, 'V', 3)}, yet they stop at {listed}: friction near "
            "standstill exceeds the line's, or changed between the runs"
        )
    left = float(np.exp(-time_constant.p_corrected * STEADY_PART * vibration.t[-1]))
    if left > 0.01:
        notes.append(f"the half-period is short: {100.0 * left:.0f} % of the transient is left where vss is read")
    if len(vibration.estimates) < 2:
        notes.append("ωd rests on a single interval between extrema, so its error is unknown")
    period = 2.0 * pi / vibration.omega_d
    if time_constant.t63 < 0.25 * period:
        notes.append(
            "v1 reaches 63 % within a quarter of the vibration's period, when cart 1 still runs ahead of cart 2: the "
            "reading is shorter than the real pole's even after the correction for Coulomb friction, which knows a "
            "rigid drive only; pass p=, the real pole for which the simulated v1 rises as the recorded one does (3.3)"
        )
    if time_constant.t63 < _SETTLED:
        notes.append(
            f"t63 = {1e3 * time_constant.t63:.2g} ms is as short as the jump of v1 right after the reversal (play and "
            "compliance between motor and cart): p is not the real pole's; adjust it with p= against a simulation (3.3)"
        )
    if iterations[-1].zeta_of_poles > 0.3:
        notes.append("ζ above 0.3 is not the poorly damped pair that Steps 1-6 assume")
    return notes

"""Root locus, Nyquist and Bode of the sampled linear loop, and the describing-function limit over amplitude, as charts.

The loop is broken at the command (:mod:`baselines.loop_analysis.loops`). Poles z of the sampled loop are drawn at ln(z)/Ts,
where students know them from the continuous loop. Everything here takes milliseconds, but for :func:`amplitude_limit`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import inf, nan, pi

import numpy as np

from baselines.controllers.p_control import proportional
from baselines.lab_page import texts
from baselines.lab_page.chart import Axis, Chart, Colour, Line, series
from baselines.loop_analysis.limit_cycle import limit_cycle_curve
from baselines.loop_analysis.loops import ComplexArray, closed_loop_matrices, linear_part, loop_response
from flexdrive_gym import Drive, LinearController
from flexdrive_gym.recording import FloatArray

_POINTS, _LOCUS = 420, 90
AMPLITUDES_MM = np.geomspace(0.3, 120.0, 15)


def scaled(controller: LinearController, factor: float) -> LinearController:
    """Return the controller with a factor on its command, for linear theory alone."""
    if factor == 1.0:
        return controller
    rows = np.array([[factor], [1.0]])
    return controller.replace(C=controller.C * rows, D=controller.D * rows)


def poles(drive: Drive, controller: LinearController) -> ComplexArray:
    """Return the closed loop's poles ln(z)/Ts [rad/s], ndarray, shape (n,); poles at z = 0 are left out."""
    z = np.linalg.eigvals(closed_loop_matrices(drive, controller)[0])
    z = z[np.abs(z) > 1e-9]
    return np.asarray(np.log(z.astype(complex)) / controller.sample_time)


@dataclass(frozen=True)
class Reading:
    """What is read off the loop's frequency response.

    Attributes
    ----------
    stable
        Whether every pole of the closed loop lies inside the unit circle.
    gain_margin
        Factor by which the loop may be raised until it crosses -1; below 1 for an unstable loop that less gain would save;
        nan where it never crosses the negative axis.
    at
        Frequency of that vibration [rad/s].
    phase_margin_deg, crossover
        Smallest phase margin [deg] and where [rad/s]; nan where the gain never crosses 1.
    """

    stable: bool
    gain_margin: float
    at: float
    phase_margin_deg: float
    crossover: float


def frequencies(drive: Drive, sample_time: float) -> FloatArray:
    """Return frequencies for the charts [rad/s], denser around the resonance, ndarray, shape (n,)."""
    wide = np.geomspace(0.3, 0.98 * pi / sample_time, _POINTS)
    around = drive.linear.omega_n
    return np.union1d(wide, np.linspace(0.6, 1.6, _POINTS // 2) * around) if np.isfinite(around) else wide


def read(drive: Drive, controller: LinearController) -> Reading:
    """Read margins off the loop: the crossing of -180° with the largest gain, the crossover with the least margin."""
    omega = frequencies(drive, controller.sample_time)
    L = loop_response(drive, controller, omega)
    stable = bool(np.max(np.abs(np.linalg.eigvals(closed_loop_matrices(drive, controller)[0]))) < 1.0 - 1e-9)
    gain, at = _negative_axis(L, omega)
    margin, crossover = nan, nan
    size = np.log(np.abs(L))
    for i in np.flatnonzero((size[:-1] > 0.0) != (size[1:] > 0.0)):
        share = size[i] / (size[i] - size[i + 1])
        turn = np.angle(L[i + 1] / L[i])
        phase = np.angle(-L[i] * np.exp(1j * share * turn), deg=True)
        if not abs(phase) >= abs(margin):  # nan at first
            margin, crossover = float(phase), float(omega[i] * (omega[i + 1] / omega[i]) ** share)
    return Reading(stable, gain, at, abs(margin) if stable else -abs(margin), crossover)


def _negative_axis(L: ComplexArray, omega: FloatArray) -> tuple[float, float]:
    best, at = 0.0, nan
    for i in np.flatnonzero((L.imag[:-1] > 0.0) != (L.imag[1:] > 0.0)):
        share = L.imag[i] / (L.imag[i] - L.imag[i + 1])
        real = L.real[i] + share * (L.real[i + 1] - L.real[i])
        if real < -best:
            best, at = -real, float(omega[i] + share * (omega[i + 1] - omega[i]))
    return (1.0 / best if best > 1e-9 else nan), at


_Locus = tuple[FloatArray, FloatArray]


@lru_cache(maxsize=32)
def _locus(values: tuple[tuple[str, float], ...], controller: LinearController, base: float) -> _Locus:
    drive = linear_part(Drive(dict(values)))
    found = [poles(drive, scaled(controller, f / base)) for f in np.geomspace(1e-3, 30.0, _LOCUS)]
    every = np.concatenate(found)
    return every.real, every.imag


@lru_cache(maxsize=32)
def unit_p(feedback: str, sample_time: float) -> LinearController:
    """Return P-control with a gain of 1 V/mm, one object for every slider position."""
    return proportional(1.0, "x1" if feedback == "x1" else "x2", sample_time)


def root_locus(drive: Drive, controller: LinearController, factor: float) -> Chart:
    """Return the root locus over the gain, with the poles at ``factor``.

    Parameters
    ----------
    drive
        Its linear part and input delay count.
    controller
        At factor 1.
    factor
        On its command.
    """
    linear = linear_part(drive)
    around = drive.linear.omega_n if np.isfinite(drive.linear.omega_n) else 30.0
    real, imaginary = _locus(tuple(linear.values.items()), controller, 1.0)
    here = poles(linear, scaled(controller, factor))
    shown = (imaginary >= -1e-6) & (real > -4.0 * around) & (imaginary < 4.0 * around)
    now = here[here.imag >= -1e-6]
    worst = float(np.max(here.real)) if len(here) else nan
    return Chart(
        texts.ROOT_LOCUS,
        Axis(texts.REAL_AXIS, -1.6 * around, 0.8 * around),
        Axis(texts.IMAGINARY_AXIS, -0.05 * around, 1.9 * around),
        [
            series(real[shown], imaginary[shown], "soft", kind="dots"),
            series(now.real, now.imag, "bad" if worst > 1e-6 else "good", kind="crosses", name=texts.POLES_NOW),
        ],
        [Line(0.0, "x", "ink")],
        texts.ROOT_LOCUS_SUMMARY.format(real=worst),
    )


def nyquist_and_bode(drive: Drive, controller: LinearController, factor: float) -> tuple[Chart, Chart, Chart, Reading]:
    """Return Nyquist, Bode's gain, Bode's phase and the margins at ``factor``."""
    linear, law = linear_part(drive), scaled(controller, factor)
    omega = frequencies(linear, law.sample_time)
    L = loop_response(linear, law, omega)
    found = read(linear, law)
    colour: Colour = "good" if found.stable else "bad"
    near = np.abs(L) < 40.0
    nyquist = Chart(
        texts.NYQUIST,
        Axis(texts.REAL_AXIS_PLAIN, -3.0, 1.5),
        Axis(texts.IMAGINARY_AXIS_PLAIN, -2.0, 2.0),
        [
            series(np.where(near, L.real, nan), np.where(near, L.imag, nan), "accent", name="L(jω)"),
            series([-1.0], [0.0], colour, kind="crosses", name="−1"),
        ],
        [Line(0.0, "x"), Line(0.0, "y")],
        texts.NYQUIST_SUMMARY.format(gm=found.gain_margin),
        equal=True,
        circle=True,
    )
    span = (0.3, min(400.0, float(omega[-1])))
    phase = np.rad2deg(np.unwrap(np.angle(L)))
    phase -= 360.0 * np.round((phase[0] + 90.0) / 360.0)
    marks = [] if np.isnan(found.crossover) else [Line(found.crossover, "x", "good" if found.stable else "bad")]
    marks_180 = [] if np.isnan(found.at) else [Line(found.at, "x", "warn")]
    gain_label = "" if np.isnan(found.gain_margin) else texts.GAIN_MARGIN.format(gm=found.gain_margin)
    phase_label = (
        "" if np.isnan(found.crossover) else texts.PHASE_MARGIN.format(pm=found.phase_margin_deg).replace("-", "−")
    )
    size = Chart(
        texts.BODE_GAIN,
        Axis("ω [rad/s]", *span, log=True),
        Axis("|L|", 1e-3, 1e2, log=True),
        [series(omega, np.abs(L), "accent", name=gain_label)],
        [Line(1.0, "y"), *marks, *marks_180],
        gain_label,
    )
    turn = Chart(
        texts.BODE_PHASE,
        Axis("ω [rad/s]", *span, log=True),
        Axis(texts.DEGREES, -450.0, 90.0),
        [series(omega, phase, "accent", name=phase_label)],
        [Line(-180.0, "y"), *marks, *marks_180],
        phase_label,
    )
    return nyquist, size, turn, found


@lru_cache(maxsize=32)
def _amplitudes(values: tuple[tuple[str, float], ...], controller: LinearController, limit: float) -> FloatArray:
    drive = Drive(dict(values))
    curve = limit_cycle_curve(drive, controller, AMPLITUDES_MM, limit=limit)
    return np.array([s.factor for s in curve])


def amplitude_limit(drive: Drive, controller: LinearController) -> FloatArray | None:
    """Return the factor on the command that keeps a vibration of each of :data:`AMPLITUDES_MM` at its size.

    A quarter of a second the first time, then at hand.

    Returns
    -------
    ndarray, shape (15,), or None
        inf where none does; ``None`` for a rigid drive.
    """
    if drive.carts != 2:
        return None
    kept = ("m1", "m2", "b1", "b2", "k", "C", "d1", "d2", "input_delay.tau")
    values = tuple((n, drive[n]) for n in kept if n in drive.values)
    return _amplitudes(values, controller, drive.voltage_limit)


def amplitude_chart(factors: FloatArray | None, factor: float, unit: str, per_length: float, length: str) -> Chart:
    """Return the limit over amplitude, in multiples that the slider shows.

    Parameters
    ----------
    factors : ndarray, shape (15,), or None
        From :func:`amplitude_limit`, in the slider's unit.
    factor
        Where the slider stands.
    unit
        Of the slider.
    per_length, length
        Engine's mm per unit of the rig, and its name.
    """
    chart = Axis(texts.AMPLITUDE_OF_X2.format(unit=length), log=True)
    label = Axis(f"{texts.LIMIT_GAIN} [{unit}]" if unit else texts.LIMIT_FACTOR, log=True)
    if factors is None:
        return Chart(texts.DESCRIBING_FUNCTION, chart, label, summary=texts.NO_AMPLITUDE_LIMIT)
    low = float(np.min(factors))
    summary = texts.NO_AMPLITUDE_LIMIT if low == inf else texts.AMPLITUDE_SUMMARY.format(low=low, unit=unit)
    shown = np.where(np.isfinite(factors), factors, nan)
    name = texts.LIMIT_CYCLE if np.isfinite(low) else texts.NO_AMPLITUDE_LIMIT
    return Chart(
        texts.DESCRIBING_FUNCTION,
        chart,
        label,
        [series(AMPLITUDES_MM / per_length, shown, "x2", name=name)],
        [Line(factor, "y", "accent", texts.YOUR_GAIN)],
        summary,
    )


def smallest_growing(factors: FloatArray | None, factor: float) -> float | None:
    """Return the smallest vibration of x2 that grows at ``factor`` [mm], by harmonic balance; ``None`` where none does."""
    if factors is None:
        return None
    growing = np.flatnonzero(factors < factor)
    if not len(growing):
        return None
    i = int(growing[0])
    if i == 0 or not np.isfinite(factors[i - 1]):
        return float(AMPLITUDES_MM[i])
    share = np.log(factors[i - 1] / factor) / np.log(factors[i - 1] / factors[i])
    return float(AMPLITUDES_MM[i - 1] * (AMPLITUDES_MM[i] / AMPLITUDES_MM[i - 1]) ** share)

r"""Measured frequency response and the handout's table (3.4).

Gain and phase are the ratio of the fundamentals of velocity and command, both fitted by :mod:`identification.sine_fit`
on the same samples. They are reported **as measured**: the command is held over each sample and a raw-difference
velocity is the mean over the sample before, so that each lags by half a sample,

.. math::  \left(\frac{1 - e^{-j\omega T_s}}{j\omega T_s}\right)^2 \approx e^{-j\omega T_s},

7.2 deg at 20 Hz and 1 kHz. The handout has no correction for it; ``corrected=True`` divides it out (and the lag of a
filtered derivative too).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from math import pi

import numpy as np

from flexdrive_gym import LinearDrive, Recording
from flexdrive_gym.recording import BoolArray, FloatArray
from flexdrive_gym.units import LAB, Units, measured_in
from identification.signals import velocities
from identification.sine_fit import SineFit, fit_sine, transient
from identification.theoretical_response import (
    Response,
    handout_frequencies,
    response_with_friction,
    theoretical_response,
)

__all__ = [
    "CartResponse",
    "FrequencyRow",
    "FrequencyTable",
    "Response",
    "SineFit",
    "fit_sine",
    "handout_frequencies",
    "measure_frequency_response",
    "response_with_friction",
    "theoretical_response",
]

BELOW_RESOLUTION = "below resolution"
IN_NOISE = "not above noise"
# the phase of v2 runs from 0 down to -270 deg; this is the top of the branch the first point is put on
_TOP_OF_BRANCH = {1: 180.0, 2: 90.0}


@dataclass(frozen=True)
class CartResponse:
    """Response of one cart's velocity at one frequency.

    Attributes
    ----------
    gain
        v/u [(mm/s)/V].
    phase_deg
        Phase of v against u [deg]; ``None`` where flagged.
    gain_ci, phase_ci
        95 % intervals [(mm/s)/V], [deg].
    flag
        Empty, ``below resolution`` where the cart's position moves by less than one encoder count either way, or
        ``not above noise`` where the amplitude's interval reaches zero.
    fit
        The sine fitted to the velocity.
    """

    gain: float = field(metadata=measured_in("mm/s/V"))
    phase_deg: float | None
    gain_ci: tuple[float, float] = field(metadata=measured_in("mm/s/V"))
    phase_ci: tuple[float, float] | None
    flag: str
    fit: SineFit = field(metadata=measured_in("mm/s"))


@dataclass(frozen=True)
class FrequencyRow:
    """One line of the handout's table.

    Attributes
    ----------
    frequency
        Of the command [Hz].
    u_amplitude
        Fitted amplitude of the command [V].
    cart1, cart2
        The carts' responses; ``None`` where the cart was not recorded, or its sensor was faulty most of the time.
    recording
        Name of the run.
    """

    frequency: float = field(metadata=measured_in("Hz"))
    u_amplitude: float = field(metadata=measured_in("V"))
    cart1: CartResponse | None
    cart2: CartResponse | None
    recording: str

    @property
    def omega(self) -> float:
        """Frequency [rad/s]."""
        return 2.0 * pi * self.frequency

    def cart(self, number: int) -> CartResponse | None:
        """Return the response of cart 1 or 2."""
        return self.cart1 if number == 1 else self.cart2


@dataclass(frozen=True)
class FrequencyTable:
    """Measured frequency response, sorted by frequency; prints in the format of handout 3.4.

    Attributes
    ----------
    rows
        One per sine run.
    corrected
        Whether the lags of hold and difference are divided out.
    notes
        Runs and carts that could not be used, and why.
    """

    rows: tuple[FrequencyRow, ...]
    corrected: bool = False
    notes: tuple[str, ...] = ()
    units: Units = LAB

    @property
    def amplitude(self) -> float:
        """Median amplitude of the command [V]."""
        return float(np.median([row.u_amplitude for row in self.rows]))

    def as_table(self) -> tuple[list[str], list[list[str]]]:
        """Return column titles and cells in the format of handout 3.4."""
        columns = ["Frequency [Hz]"]
        one = self.units.one("mm/s/V")
        for i in (1, 2):
            columns += [self.units.name(f"Gain v{i}/u [(mm/s)/V]"), f"Phase ∠(v{i}/u) [deg]"]
        cells = [
            [
                f"{row.frequency / self.units.one('Hz'):.4g}",
                *(cell for c in (row.cart1, row.cart2) for cell in (_gain_cell(c, one), _phase_cell(c))),
            ]
            for row in self.rows
        ]
        return columns, cells

    def __str__(self) -> str:
        columns, rows = self.as_table()
        lines = [" | ".join(f"{cell:<22}" for cell in cells).rstrip() for cells in (columns, *rows)]
        lines.insert(1, "-" * len(lines[0]))
        lag = "lags of hold and difference removed" if self.corrected else "phases as measured"
        lines.append(f"u = ±{self.units.text(self.amplitude, 'V', 3)}; ± 95 %; {lag}")
        return "\n".join(lines + [f"note: {note}" for note in self.notes])


def _gain_cell(response: CartResponse | None, one: float) -> str:
    if response is None:
        return "-"
    half = (response.gain_ci[1] - response.gain) / one
    return f"{response.gain / one:.4g}" + (f" ± {half:.2g}" if np.isfinite(half) else "")


def _phase_cell(response: CartResponse | None) -> str:
    if response is None:
        return "-"
    if response.phase_deg is None or response.phase_ci is None:
        return response.flag
    return f"{response.phase_deg:.1f} ± {response.phase_ci[1] - response.phase_deg:.1f}"


def measure_frequency_response(
    recordings: Iterable[Recording], *, model: LinearDrive | None = None, corrected: bool = False
) -> FrequencyTable:
    """Measure gain and phase of both velocities on every sine run.

    The first period, and at least the first second, is left out as transient; faulty samples are too.

    Parameters
    ----------
    recordings
        Runs; those whose excitation is not a sine are ignored.
    model
        Drive whose phase the branch of every phase is taken nearest to. Without one, v1 starts within ±180 deg and v2
        within (-270, 90] deg at the lowest frequency, and each continues along frequency without jumps of 360 deg.
    corrected
        Divide out the half-sample lags of hold and difference.

    Returns
    -------
    FrequencyTable
        Sorted by frequency.

    Raises
    ------
    ValueError
        If no run is a sine of at least one whole period.
    """
    sines = sorted(
        (r for r in recordings if r.excitation.kind == "sine"), key=lambda r: (r.excitation.frequency, r.name)
    )
    long_enough = [run for run in sines if run.n * run.sample_time * run.excitation.frequency >= 1.0]
    if not long_enough:
        raise ValueError(
            f"recordings: at least one must be a sine run of one whole period; got {len(sines)} sine runs, all shorter. "
            "Record handout 2.6: ±2.5 V, 0.5 ... 20 Hz, 8 s each."
        )
    notes = [f"{run.name}: shorter than one period, left out" for run in sines if run not in long_enough]
    rows = [_row(run, corrected, notes) for run in long_enough]
    for cart in (1, 2):
        rows = _on_branch(rows, cart, model)
    return FrequencyTable(tuple(rows), corrected, tuple(notes), long_enough[0].units)


def _row(run: Recording, corrected: bool, notes: list[str]) -> FrequencyRow:
    frequency = run.excitation.frequency
    responses: list[CartResponse | None] = [None, None]
    signals = velocities(run)
    for i, v in enumerate(signals):
        valid = run.valid("v1" if i == 0 else "v2")
        try:
            responses[i] = _cart_response(run, v, valid, run.quantum[i], corrected)
        except ValueError as error:  # a faulty sensor takes one cell from the table, not the table
            notes.append(f"{run.name}, cart {i + 1}: {error}")
    u = fit_sine(run.t, run.u, frequency, skip=_skip(run))
    return FrequencyRow(frequency, u.amplitude, responses[0], responses[1], run.name)


def _skip(run: Recording) -> float:
    """Return the transient to leave out [s]; a run too short for that keeps its last whole period."""
    frequency = run.excitation.frequency
    whole = run.n * run.sample_time - 1.0 / frequency
    return max(0.0, min(transient(frequency), whole))


def _cart_response(run: Recording, v: FloatArray, valid: BoolArray, quantum: float, corrected: bool) -> CartResponse:
    frequency = run.excitation.frequency
    fit = fit_sine(run.t, v, frequency, valid, skip=_skip(run))
    # the command on the same samples, so that a gap takes the same from both
    u = fit_sine(run.t, run.u, frequency, valid, skip=_skip(run))
    ratio = fit.phasor / u.phasor
    if corrected:
        ratio /= _lags(frequency, run.sample_time, run.velocity_cutoff or 0.0)
    scale = abs(ratio) / fit.amplitude if fit.amplitude > 0.0 else 0.0
    phase = float(np.rad2deg(np.angle(ratio)))
    half = fit.phase_ci[1] - fit.phase_deg
    flag = ""
    # half of the position's swing against one count: what is below is a pattern of single counts
    if fit.amplitude / (2.0 * pi * frequency) < quantum:
        flag = BELOW_RESOLUTION
    elif not fit.significant:
        flag = IN_NOISE
    return CartResponse(
        gain=abs(ratio),
        phase_deg=None if flag else phase,
        gain_ci=(scale * fit.amplitude_ci[0], scale * fit.amplitude_ci[1]),
        phase_ci=None if flag else (phase - half, phase + half),
        flag=flag,
        fit=fit,
    )


def _lags(frequency: float, sample_time: float, cutoff: float) -> complex:
    """Return the response of hold, difference and derivative filter together."""
    turn = complex(np.exp(-2j * pi * frequency * sample_time))
    half = (1.0 - turn) / (2j * pi * frequency * sample_time)
    a = float(np.exp(-2.0 * pi * cutoff * sample_time)) if cutoff > 0.0 else 0.0
    return half**2 * (1.0 - a) / (1.0 - a * turn)


def _on_branch(rows: Sequence[FrequencyRow], cart: int, model: LinearDrive | None) -> list[FrequencyRow]:
    """Move every phase of one cart by whole turns onto the right branch."""
    target = _model_phase(rows, cart, model)
    last: float | None = None
    result = []
    for i, row in enumerate(rows):
        response = row.cart(cart)
        if response is not None and response.phase_deg is not None and response.phase_ci is not None:
            near = target(i) if target is not None else last
            if near is None:
                near = _TOP_OF_BRANCH[cart] - 180.0
            turns = 360.0 * round((near - response.phase_deg) / 360.0)
            last = response.phase_deg + turns
            interval = (response.phase_ci[0] + turns, response.phase_ci[1] + turns)
            moved = replace(response, phase_deg=last, phase_ci=interval)
            row = replace(row, cart1=moved) if cart == 1 else replace(row, cart2=moved)  # noqa: PLW2901
        result.append(row)
    return result


def _model_phase(rows: Sequence[FrequencyRow], cart: int, model: LinearDrive | None) -> Callable[[int], float] | None:
    if model is None or (cart == 2 and model.rigid):
        return None
    measured = np.array([row.omega for row in rows])
    # unwrapped along a dense grid: between two measured frequencies the phase may fall by more than half a turn
    grid = np.union1d(np.logspace(-1.0, np.log10(10.0 * measured.max()), 1000), measured)
    phase = np.interp(measured, grid, theoretical_response(model, grid).phase(cart))
    return lambda i: float(phase[i])

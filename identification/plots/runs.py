"""Recorded and simulated runs in the formats of handout 2.5, 3.3 and 3.5."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from identification.frequency_response import measure_frequency_response
from identification.plots import style
from identification.plots.style import (
    draw_velocity,
    heading,
    legend_above,
    moving_mean,
    new_figure,
    shade_faults,
    styled,
)
from identification.signals import velocities

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from flexdrive_gym import Recording
    from flexdrive_gym.recording import FloatArray
    from flexdrive_gym.units import Units
    from identification.frequency_response import FrequencyRow

# periods of each sine that are shown, from the end of the run
_SHOWN_PERIODS = 3.0
_MOST_SINES = 4


@styled
def plot_recording(recording: Recording) -> Figure:
    """Plot a run in the handout's format, faulty stretches shaded (3.5).

    Parameters
    ----------
    recording
        Open loop: v1 and v2 on top, u at the bottom. Closed loop: xr with x1, xr with x2, the tracking error
        e = xr - x2 of cart 2, and u.

    Returns
    -------
    matplotlib.figure.Figure
    """
    recording = recording.in_rig_units()
    if recording.xr is not None and recording.x1 is not None:
        return _closed_loop(recording)
    figure = new_figure(4.0)
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=[2.2, 1.0])
    for cart, v in enumerate(velocities(recording), start=1):
        draw_velocity(top, recording.t, v, style.CART[cart], f"$v_{cart}$")
    _command(bottom, recording)
    shade_faults(top, recording, "encoder_1", "encoder_2")
    shade_faults(bottom, recording, "actuator")
    top.set_ylabel(recording.units.name("velocity [mm/s]"))
    heading(figure, f"{recording.name}: {recording.excitation.text(recording.units)}")
    legend_above(top)
    return figure


def _command(axes: Axes, recording: Recording) -> None:
    # the command is held over each sample
    axes.step(recording.t, recording.u, where="post", color=style.COMMAND, linewidth=1.0)
    axes.set_ylabel(recording.units.name("command $u$ [V]"))
    axes.set_xlabel("time $t$ [s]")
    axes.set_xlim(float(recording.t[0]), float(recording.t[-1]))


def _closed_loop(recording: Recording) -> Figure:
    figure = new_figure(6.4)
    first, second, error, command = figure.subplots(4, 1, sharex=True, height_ratios=[1.4, 1.4, 1.0, 1.0])
    t, xr = recording.t, recording.xr
    assert xr is not None
    for axes, cart, x in ((first, 1, recording.x1), (second, 2, recording.x2)):
        axes.plot(t, xr, color=style.REFERENCE, linestyle="--", linewidth=1.0, label="reference $x_r$")
        if x is not None:
            axes.plot(t, x, color=style.CART[cart], label=f"cart {cart}, $x_{cart}$")
        axes.set_ylabel(recording.units.name("position [mm]"))
    followed, name, colour = (
        (recording.x2, "x_2", style.CART[2]) if recording.x2 is not None else (recording.x1, "x_1", style.CART[1])
    )
    assert followed is not None
    error.plot(t, xr - followed, color=colour)
    error.axhline(0.0, color=style.REFERENCE, linewidth=0.8)
    error.set_ylabel(recording.units.name(f"error $x_r - {name}$ [mm]"))
    _command(command, recording)
    behind = (
        (first, "encoder_1"),
        (second, "encoder_2"),
        (error, f"encoder_{name[-1]}"),
        (command, "actuator"),
    )
    for axes, place in behind:
        shade_faults(axes, recording, place)
    for axes in (first, second, command):
        legend_above(axes)
    heading(figure, f"{recording.name}: {recording.excitation.text(recording.units)}")
    return figure


def _select(rows: Sequence[FrequencyRow], natural_frequency: float | None) -> tuple[list[FrequencyRow], float]:
    """Return up to four rows below, at, above the resonance and far above it, and the natural frequency [Hz]."""
    resonance = natural_frequency or _resonance(rows)
    wanted = [0.0, resonance, 1.4 * resonance, 4.0 * resonance]
    chosen: list[FrequencyRow] = []
    for target in wanted:
        left = [row for row in rows if row not in chosen]
        if left:
            chosen.append(min(left, key=lambda row: abs(row.frequency - target)))
    return sorted(chosen[:_MOST_SINES], key=lambda row: row.frequency), resonance


def _resonance(rows: Sequence[FrequencyRow]) -> float:
    """Return where v1's gain peaks above the antiresonance, else where v2's (or v1's) gain is largest [Hz]."""
    gains = [row.cart1.gain if row.cart1 is not None else 0.0 for row in rows]
    peaks = [i for i in range(1, len(rows) - 1) if gains[i - 1] < gains[i] > gains[i + 1]]
    if peaks:
        return rows[max(peaks, key=gains.__getitem__)].frequency
    second = [row.cart2.gain if row.cart2 is not None else 0.0 for row in rows]
    return rows[int(np.argmax(second if max(second) > 0.0 else gains))].frequency


def _lag(row: FrequencyRow) -> str:
    first, second = row.cart1, row.cart2
    if first is None or second is None or first.phase_deg is None or second.phase_deg is None:
        return "lag not readable"
    return f"cart 2 lags cart 1 by {first.phase_deg - second.phase_deg:.0f}°"


def _amplitudes(row: FrequencyRow, units: Units) -> str:
    cells = ((1, row.cart1), (2, row.cart2))
    return ", ".join(f"v{i} {units.text(cell.fit.amplitude, 'mm/s', 3)}" for i, cell in cells if cell is not None)


def caption_of_sines(recordings: Sequence[Recording], *, natural_frequency: float | None = None) -> str:
    """Return the caption of :func:`plot_sines`: natural frequency, amplitudes and the lag between the carts."""
    rows, resonance = _select(measure_frequency_response(recordings).rows, natural_frequency)
    source = "identified" if natural_frequency is not None else "read off the peak of the gain"
    lines = [f"Natural frequency {resonance:.3g} Hz ({2.0 * np.pi * resonance:.3g} rad/s, {source})."]
    lines += [
        f"{row.frequency:.3g} Hz: amplitudes {_amplitudes(row, recordings[0].units)}; {_lag(row)}." for row in rows
    ]
    return "\n".join(lines)


@styled
def plot_sines(recordings: Sequence[Recording], *, natural_frequency: float | None = None) -> Figure:
    """Plot up to four sine runs, below, at, above and far above resonance, in the format of 2.5 (handout 3.5).

    Parameters
    ----------
    recordings
        Runs; those whose excitation is not a sine are ignored.
    natural_frequency
        ωn/2π [Hz], where it is known; read off the peak of the measured gain otherwise.

    Returns
    -------
    matplotlib.figure.Figure
        Its caption is :func:`caption_of_sines`.
    """
    rows, _ = _select(measure_frequency_response(recordings).rows, natural_frequency)
    runs = {recording.name: recording.in_rig_units() for recording in recordings}
    one = recordings[0].units.one("Hz")
    figure = new_figure(4.6)
    grid = figure.subplots(2, len(rows), sharey="row", squeeze=False, height_ratios=[2.2, 1.0])
    for (top, bottom), row in zip(grid.T, rows, strict=True):
        run = runs[row.recording]
        for cart, v in enumerate(velocities(run), start=1):
            draw_velocity(top, run.t, v, style.CART[cart], f"$v_{cart}$")
        _command(bottom, run)
        shade_faults(top, run, "encoder_1", "encoder_2")
        shade_faults(bottom, run, "actuator")
        for axes in (top, bottom):
            axes.set_xlim(float(run.t[-1]) - _SHOWN_PERIODS * one / row.frequency, float(run.t[-1]))
            axes.locator_params(axis="x", nbins=3)
            axes.label_outer(remove_inner_ticks=False)
        top.tick_params(labelbottom=False)
        top.set_title(f"{row.frequency / one:.3g} Hz", loc="left")
        bottom.set_xlabel("time $t$ [s]")
    grid[0, 0].set_ylabel(recordings[0].units.name("velocity [mm/s]"))
    grid[0, -1].legend(loc="upper right")  # the fastest sine moves least and leaves room
    return figure


def _signals(run: Recording, *, positions: bool) -> list[FloatArray]:
    if positions:
        return [x for x in (run.x1, run.x2) if x is not None]
    return velocities(run)


@styled
def plot_validation(measured: Recording, simulated: Recording, *, title: str = "") -> Figure:
    """Plot simulated over measured: cart 1 on top, cart 2 in the middle, u at the bottom (handout 3.3).

    Velocities for open-loop runs; positions for P-control, with the reference and the simulated command.

    Parameters
    ----------
    measured
        A recorded run.
    simulated
        The drive's answer to its command.
    title
        Heading; the run's name and excitation by default.

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure = new_figure(5.2)
    simulated = replace(simulated, units=measured.units).in_rig_units()
    measured = measured.in_rig_units()
    positions = measured.closed_loop and measured.x1 is not None and simulated.x1 is not None
    both = list(zip(*(_signals(run, positions=positions) for run in (measured, simulated)), strict=False))
    panels = figure.subplots(len(both) + 1, 1, sharex=True, height_ratios=[*[2.0] * len(both), 1.0])
    for cart, (axes, (real, model)) in enumerate(zip(panels[:-1], both, strict=True), start=1):
        samples = 1 if positions else round(0.015 / measured.sample_time) | 1
        if positions and measured.xr is not None:
            axes.plot(measured.t, measured.xr, color=style.REFERENCE, linestyle="--", label="reference $x_r$")
        if not positions:
            axes.plot(measured.t, real, color=style.MEASURED, alpha=0.35, linewidth=0.4)
        axes.plot(measured.t, moving_mean(real, samples), color=style.COMMAND, linewidth=0.8, label="measured")
        axes.plot(
            simulated.t,
            moving_mean(model, samples),
            color=style.CART[cart],
            linewidth=1.6,
            alpha=0.85,
            label="simulated",
        )
        shade_faults(axes, measured, f"encoder_{cart}")
        label = f"position $x_{cart}$ [mm]" if positions else f"velocity $v_{cart}$ [mm/s]"
        axes.set_ylabel(measured.units.name(label))
        legend_above(axes)
    _command(panels[-1], measured)
    if positions:
        panels[-1].plot(simulated.t, simulated.u, color=style.MEASURED, linestyle=":", label="simulated")
        panels[-1].lines[0].set_label("measured")
        legend_above(panels[-1])
    heading(figure, title or f"{measured.name}: {measured.excitation.text(measured.units)}")
    return figure

"""Figures of learnt policies beside classical designs; each function takes data and returns a matplotlib Figure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.ticker import LogLocator, NullFormatter

from baselines.compare import Behaviour, Comparison, Summary
from baselines.compare.behaviour import SIGNALS
from baselines.loop_analysis.describing_function import analytic_response
from flexdrive_gym import LinearController
from flexdrive_gym.recording import FloatArray
from flexdrive_gym.units import LAB, Units, in_rig_units
from identification.plots.style import CART, COMMAND, MARK, REFERENCE, legend_above, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from baselines.compare.behaviour import Shown
    from baselines.compare.lesson import Lesson

SHADES = ("#8fb8de", "#3f7fbf", "#123f6d")


@styled
def plot_responses(found: Behaviour, reference: str, units: Units = LAB) -> Figure:
    """Draw xr, x1 and x2, the error and the command of every shown controller along one reference, a row each.

    Figures are drawn as they are given; ``units`` names them.
    """
    xr = found.references[reference]
    figure = new_figure(0.5 + 1.25 * len(found.shown), width=9.5)
    panels = figure.subplots(len(found.shown), 3, sharex=True, sharey="col", squeeze=False)
    for shown, (position, error, command) in zip(found.shown, panels, strict=True):
        kind = "learnt" if shown.result.entry.learnt else shown.result.entry.feedback
        _draw_tracking(position, error, found.t, xr, shown.runs[reference], f"{shown.name} ({kind})", units)
        u = shown.runs[reference][4]
        command.plot(found.t, u, color=COMMAND, linewidth=0.7)
        command.set_title(f"rms {np.sqrt(np.mean(u**2)):.3g} {units.command}", loc="left", fontsize=8.5)
        command.set_ylabel("u [V]")
    # one scale for all: the error of the second worst fits, what leaves it is in the title
    peaks = sorted(float(np.max(np.abs(xr - s.runs[reference][2]))) for s in found.shown)
    top = 1.1 * peaks[max(len(peaks) - 2, 0)]
    panels[0, 1].set_ylim(-top, top)
    low, high = float(np.min(xr)), float(np.max(xr))
    panels[0, 0].set_ylim(low - 0.3 * (high - low), high + 0.3 * (high - low))
    for axes in panels[-1]:
        axes.set_xlabel("time [s]")
    legend_above(panels[0, 0])
    return figure


@styled
def plot_lesson(found: Lesson) -> Figure:
    """Draw positions and error of every demonstration of a lesson, a row each, in the rig's units."""
    units = found.drive.units
    t, xr = found.t / units.one("s"), found.xr / units.one("mm")
    figure = new_figure(0.5 + 1.15 * len(found.shown), width=8.5)
    panels = figure.subplots(len(found.shown), 2, sharex=True, sharey="col", squeeze=False)
    for shown, (position, error) in zip(found.shown, panels, strict=True):
        run = in_rig_units(shown.run, units, SIGNALS)
        _draw_tracking(position, error, t, xr, run, shown.name, units)
    for axes in panels[-1]:
        axes.set_xlabel("time [s]")
    legend_above(panels[0, 0])
    return figure


def _draw_tracking(
    position: Axes, error: Axes, t: FloatArray, xr: FloatArray, run: FloatArray, title: str, units: Units
) -> None:
    """Draw positions and tracking error of a run, ndarray, shape (5, n): x1, v1, x2, v2, u."""
    e = xr - run[2]
    position.plot(t, run[0], color=CART[1], linewidth=0.7, alpha=0.7, label="$x_1$")
    position.plot(t, run[2], color=CART[2], label="$x_2$")
    position.plot(t, xr, color=REFERENCE, linewidth=1.0, linestyle="--", label="$x_r$")
    error.plot(t, e, color=CART[2], linewidth=0.9)
    error.axhline(0.0, color=COMMAND, linewidth=0.6)
    position.set_title(title, loc="left", fontsize=8.5)
    error.set_title(f"rms {np.sqrt(np.mean(e**2)):.3g} {units.length}", loc="left", fontsize=8.5)
    position.set_ylabel("[mm]")
    error.set_ylabel("$x_r - x_2$ [mm]")


@styled
def plot_sweeps(found: Behaviour, units: Units = LAB) -> Figure:
    """Draw equivalent gain and phase of every swept policy at each amplitude, beside Lab 4's frequency response.

    Figures are drawn as they are given, in the rig's ``units``.
    """
    learnt = [s for s in found.shown if s.sweep is not None and s.result.entry.learnt]
    lab4 = next((s for s in found.shown if s.name == "lab4"), None)
    figure = new_figure(4.4, width=3.9 * len(learnt) + 0.6 if len(learnt) > 1 else 6.2)
    panels = figure.subplots(2, len(learnt), sharex=True, sharey="row", squeeze=False)
    for shown, (gain, phase) in zip(learnt, panels.T, strict=True):
        assert shown.sweep is not None
        f = shown.sweep.frequencies
        for amplitude, row, colour in zip(shown.sweep.amplitudes, shown.sweep.response, SHADES, strict=True):
            gain.loglog(
                f,
                np.abs(row),
                "o-",
                color=colour,
                markersize=2.5,
                linewidth=1.0,
                label=f"{amplitude:.3g} {units.length}",
            )
            phase.semilogx(f, np.rad2deg(np.unwrap(np.angle(row))), "o-", color=colour, markersize=2.5, linewidth=1.0)
        if lab4 is not None:
            _draw_lab4(gain, phase, lab4, units)
        gain.set_title(f"{shown.name}, sine on {shown.sweep.reads}", loc="left", fontsize=8.5)
        phase.set_xlabel("frequency [Hz]")
        phase.set_xticks(ticks := [0.25, 0.5, 1, 2, 5, 10, 20], [f"{v:g}" for v in ticks])
        phase.minorticks_off()
        gain.legend(loc="upper left")
    panels[0, 0].set_ylabel("command over error [V/mm]")
    panels[1, 0].set_ylabel("phase [deg]")
    return figure


def _draw_lab4(gain: Axes, phase: Axes, lab4: Shown, units: Units) -> None:
    controller = lab4.result.entry.controller
    assert isinstance(controller, LinearController)
    f = np.geomspace(0.25, 20.0, 300)
    known = analytic_response(controller, "x2", f * units.one("Hz")) / units.one("V/mm")
    gain.loglog(f, np.abs(known), color=MARK, linewidth=1.0, label="Lab 4, known")
    phase.semilogx(f, np.rad2deg(np.unwrap(np.angle(known))), color=MARK, linewidth=1.0)
    if lab4.sweep is not None:
        row = lab4.sweep.response[0]
        label = f"Lab 4 by the sweep, {lab4.sweep.amplitudes[0]:.3g} {units.length}"
        gain.loglog(lab4.sweep.frequencies, np.abs(row), "x", color=MARK, markersize=3.5, label=label)
        phase.semilogx(lab4.sweep.frequencies, np.rad2deg(np.unwrap(np.angle(row))), "x", color=MARK, markersize=3.5)


@styled
def plot_intervals(comparison: Comparison, summaries: Sequence[Summary]) -> Figure:
    """Draw the interquartile mean of rms with its interval, along the handout's trajectory and over left-out effects."""
    learnt = {g.name for g in comparison.groups if g.learnt}
    figure = new_figure(0.9 + 0.2 * len(summaries), width=8.5)
    with_effects = any(c.group == "effect" for c in comparison.cases)
    panels = figure.subplots(1, 1 + with_effects, sharey=True, squeeze=False)[0]
    ordered = sorted(summaries, key=lambda s: -s.rms.value)
    for axes, name, title in zip(
        panels, ("rms", "effects"), ("the drive and its covariance", "each left-out effect"), strict=False
    ):
        for y, s in enumerate(ordered):
            of = getattr(s, name)
            colour = MARK if s.name in learnt else CART[1]
            axes.plot([of.low, of.high], [y, y], color=colour, linewidth=4.0, alpha=0.35, solid_capstyle="butt")
            axes.plot([of.value], [y], "|", color=colour, markersize=8, markeredgewidth=1.6)
        axes.set(xscale="log", yticks=range(len(ordered)), yticklabels=[s.name for s in ordered])
        axes.set_xlabel("rms $x_r - x_2$ [mm], interquartile mean")
        axes.set_title(title, loc="left", fontsize=8.5)
        axes.xaxis.set_major_formatter("{x:g}")
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.tick_params(axis="x", which="both", labelsize=7)
    return figure

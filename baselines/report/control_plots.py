"""Figures of stability, design and comparison; each function takes data and returns a matplotlib Figure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.ticker import LogLocator

from baselines.loop_analysis.loops import loop_response, response
from flexdrive_gym import Drive, LinearController, LinearDrive, Recording
from flexdrive_gym.recording import FloatArray
from flexdrive_gym.units import LAB, Units
from identification.plots.style import (
    CART,
    COMMAND,
    MARK,
    REFERENCE,
    heading,
    legend_above,
    new_figure,
    shade_faults,
    styled,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from baselines.compare import Comparison, Result
    from baselines.lab.lab4_study import Stage
    from baselines.loop_analysis.limit_cycle import LimitCycle

COLOURS = ("#1f5a99", "#d9660f", "#2e7d4f", "#8a3ea8", "#b3202c", "#6b6b6b", "#c79a00", "#127c8a")
LINES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1.2, 1.2)), (0, (6, 1.5, 1.2, 1.5)), (0, (9, 2, 3, 2)))


def look(i: int) -> dict[str, Any]:
    """Return colour and line of the i-th of many: lines differ without colours too."""
    return {"color": COLOURS[i % len(COLOURS)], "linestyle": LINES[i % len(LINES)]}


@styled
def plot_root_loci(linear: LinearDrive, critical: Mapping[str, float | None]) -> Figure:
    """Draw the closed loop's poles over the P gain, for feedback from x1 and from x2.

    Parameters
    ----------
    linear
        The linear drive.
    critical
        Feedback to the linear critical gain [V/mm], ``None`` where there is none.
    """
    figure = new_figure(3.5)
    for axes, feedback in zip(figure.subplots(1, 2, sharey=True), ("x1", "x2"), strict=True):
        numerator = linear.numerator(feedback)  # type: ignore[arg-type]
        limit = critical.get(feedback)
        top = 4.0 * limit if limit else 2.0
        gains = np.concatenate([[0.0], np.geomspace(1e-4, top, 3000)])
        roots = np.array([np.roots(np.polyadd(linear.denominator, g * numerator)) for g in gains])
        points = roots.ravel()
        shade = np.repeat(np.arange(len(gains)), roots.shape[1])
        axes.scatter(points.real, points.imag, c=shade, cmap="Blues_r", s=1.5, vmax=1.4 * len(gains), linewidths=0.0)
        poles, zeros = linear.poles, linear.zeros(feedback)  # type: ignore[arg-type]
        axes.plot(
            poles.real, poles.imag, "x", color=COMMAND, markersize=7, markeredgewidth=1.5, label="poles of the drive"
        )
        if len(zeros):
            axes.plot(zeros.real, zeros.imag, "o", color=COMMAND, markerfacecolor="none", markersize=7, label="zeros")
        if limit:
            at = np.roots(np.polyadd(linear.denominator, limit * numerator))
            edge = at[np.argsort(np.abs(at.real))[:2]]
            axes.plot(edge.real, edge.imag, "D", color=MARK, markersize=5, label=f"Kp = {limit:.4g} V/mm")
        axes.axvline(0.0, color=COMMAND, linewidth=0.8)
        extent = 2.2 * linear.omega_n
        axes.set(xlim=(-extent, 0.7 * extent), ylim=(-1.4 * extent, 1.4 * extent), xlabel="real part [rad/s]")
        axes.set_title(
            f"feedback from {feedback}: {'collocated' if feedback == 'x1' else 'non-collocated'}", loc="left"
        )
        axes.legend(loc="lower right")
    figure.axes[0].set_ylabel("imaginary part [rad/s]")
    return figure


@styled
def plot_amplitude(
    curve: Sequence[LimitCycle], simulated: Sequence[tuple[float, float]], routh: float, lines: Mapping[str, float]
) -> Figure:
    """Draw the critical gain over the amplitude of the vibration.

    Parameters
    ----------
    curve
        Of harmonic balance for a P-controller of 1 V/mm, so that its factor is Kp.
    simulated
        Pairs of amplitude [mm] and critical gain [V/mm] by simulation.
    routh
        Linear critical gain [V/mm].
    lines
        Other gains to mark [V/mm].
    """
    figure = new_figure(3.6)
    axes = figure.subplots()
    finite = [s for s in curve if np.isfinite(s.factor)]
    axes.plot([s.amplitude for s in finite], [s.factor for s in finite], color=CART[2], label="describing function")
    shown = [(a, g) for a, g in simulated if np.isfinite(g)]
    axes.plot([a for a, _g in shown], [g for _a, g in shown], "o", color=CART[1], markersize=4, label="simulated")
    axes.axhline(routh, color=COMMAND, linewidth=0.9, label=f"linear (Routh): {routh:.4g}")
    for i, (name, value) in enumerate(lines.items()):
        axes.axhline(value, **{**look(4 + i), "linestyle": ":"}, label=f"{name}: {value:.4g}")
    top = 3.0 * routh
    axes.set(xscale="log", ylim=(0.0, top), xlabel="amplitude of x2 [mm]", ylabel="critical Kp [V/mm]")
    axes.fill_between(
        [s.amplitude for s in finite], [min(s.factor, top) for s in finite], top, color=MARK, alpha=0.08, linewidth=0.0
    )
    axes.text(0.42, 0.92, "vibration grows", transform=axes.transAxes, color=MARK, fontsize=8)
    axes.text(0.02, 0.05, "vibration dies out", transform=axes.transAxes, fontsize=8)
    axes.set_xticks(ticks := [2, 3, 5, 10, 20, 30, 50, 80], [str(v) for v in ticks])
    axes.minorticks_off()
    axes.legend(loc="upper left", bbox_to_anchor=(0.42, 0.88))
    return figure


def _distinct(controllers: Mapping[str, LinearController]) -> dict[str, LinearController]:
    """Join controllers of the same loop under one name, so that no line hides another."""
    at = np.geomspace(0.5, 1000.0, 40) * 1e-3
    kept: list[tuple[str, LinearController, FloatArray]] = []
    for name, c in controllers.items():
        seen = np.abs(response(c.A, c.B, c.C[:1], c.D[:1], at, 1.0)[:, 0, 1:])
        for i, (other, first, theirs) in enumerate(kept):
            if np.allclose(seen, theirs, rtol=1e-6, atol=1e-12):
                kept[i] = (f"{other}, {name}", first, theirs)
                break
        else:
            kept.append((name, c, seen))
    return {name: c for name, c, _seen in kept}


@styled
def plot_loops(drive: Drive, controllers: Mapping[str, LinearController], crossover: float | None = None) -> Figure:
    """Draw the Bode plot of loop gains, sampled as they are."""
    figure = new_figure(4.8)
    controllers = _distinct(controllers)
    gain, phase = figure.subplots(2, 1, sharex=True)
    omega, one = np.geomspace(0.5, 1000.0, 1500), drive.units.one("rad/s")
    for i, (name, controller) in enumerate(controllers.items()):
        L = loop_response(drive, controller, omega)
        gain.loglog(omega / one, np.abs(L), **look(i), label=name)
        phase.semilogx(omega / one, np.rad2deg(np.unwrap(np.angle(L))), **look(i))
    gain.axhline(1.0, color=COMMAND, linewidth=0.8)
    phase.axhline(-180.0, color=COMMAND, linewidth=0.8)
    phase.axhline(-150.0, color=COMMAND, linewidth=0.6, linestyle=":")
    if crossover is not None:
        for axes in (gain, phase):
            axes.axvline(crossover / one, color=MARK, linewidth=0.8, linestyle=":")
    gain.set(ylabel="|L|", ylim=(1e-3, 1e2))
    phase.set(ylabel="phase of L [deg]", xlabel="frequency [rad/s]", ylim=(-400.0, 0.0), yticks=range(-360, 1, 90))
    if len(controllers) > 5:
        figure.legend(loc="outside right upper")
    else:
        gain.legend(loc="upper right", ncols=2)
    return figure


@styled
def plot_stage_responses(stages: Sequence[Stage], kind: str, title: str) -> Figure:
    """Draw x2 and u of every stage for one kind of run (``step``, ``disturbance``, ``rig disturbance``)."""
    figure = new_figure(4.2)
    position, command = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    for i, stage in enumerate(stages):
        run = stage.runs[kind]
        position.plot(run.t, run.states[2], **look(i), label=stage.name)
        command.plot(run.t, run.u, **look(i))
    run = stages[0].runs[kind]
    if np.any(run.xr):
        position.plot(run.t, run.xr, color=REFERENCE, linewidth=0.9)
    position.set_ylabel("$x_2$ [mm]")
    peaks = [float(np.percentile(np.abs(s.runs[kind].u), 99.0)) for s in stages]
    command.set(ylabel="u [V]", xlabel="time [s]", ylim=(-1.3 * max(peaks), 1.3 * max(peaks)))
    legend_above(position)
    heading(figure, title)
    return figure


@styled
def plot_tracking(stage: Stage) -> Figure:
    """Draw one stage on the handout's trajectory in the handout's format: positions, error, command, for every limit."""
    runs = {name: run for name, run in stage.runs.items() if name.startswith("tracking")}
    figure = new_figure(4.6)
    position, error, command = figure.subplots(3, 1, sharex=True, height_ratios=(3, 2, 2))
    first = next(iter(runs.values()))
    position.plot(first.t, first.xr, color=REFERENCE, label="$x_r$")
    for i, (name, run) in enumerate(runs.items()):
        # runs that agree lie on one another: the first is the broadest, and the dashes of the next leave it visible
        style = {**look(i), "linewidth": 1.2 + 1.4 / (1 + 2 * i) if len(runs) > 1 else 1.2}
        position.plot(run.t, run.states[2], **style, label=f"$x_2$, {name.removeprefix('tracking ')}")
        error.plot(run.t, run.xr - run.states[2], **style)
        command.plot(run.t, run.u, **style)
    position.set_ylabel("position [mm]")
    error.set_ylabel("$x_r - x_2$ [mm]")
    command.set(ylabel="u [V]", xlabel="time [s]")
    legend_above(position)
    heading(figure, stage.design.title)
    return figure


@styled
def plot_errors(
    results: Sequence[Result],
    tolerance: float,
    runs: Mapping[str, tuple[FloatArray, FloatArray]],
    t: FloatArray,
    units: Units = LAB,
) -> Figure:
    """Draw the tracking error of controllers on the nominal drive, one panel each, figures as the rig's owner reads them.

    Parameters
    ----------
    runs
        Controller to (xr - x2, u), ndarray, shape (n,).
    """
    n = len(results)
    rows = (n + 2) // 3
    figure = new_figure(0.5 + 1.15 * rows)
    panels = figure.subplots(rows, 3, sharex=True, sharey=True, squeeze=False).ravel()
    for axes in panels[n:]:
        axes.set_visible(False)
    # one scale for all; what leaves it is named in the table
    peaks = sorted(float(np.max(np.abs(e))) for e, _u in runs.values())
    top = 1.15 * peaks[int(0.75 * (len(peaks) - 1))]
    for axes, result in zip(panels, results, strict=False):
        e, _u = runs[result.entry.name]
        axes.axhspan(-tolerance, tolerance, color="#e9e9e9", linewidth=0.0)
        axes.plot(t, e, color=CART[2], linewidth=0.9)
        axes.set_title(f"{result.entry.name}: rms {result.nominal.rms:.3g} {units.length}", loc="left", fontsize=7)
        axes.set_ylim(-top, top)
    for axes in panels[:n][-3:]:
        axes.set_xlabel("time [s]")
        axes.tick_params(labelbottom=True)
    figure.supylabel("$x_r - x_2$ [mm]", fontsize=9)
    return figure


@styled
def plot_robustness(comparison: Comparison, farthest: float = 1e3) -> Figure:
    """Draw the rms error over the drawn drives and with every left-out effect, controller by controller.

    Errors beyond ``farthest`` are drawn there.
    """
    figure = new_figure(0.9 + 0.26 * len(comparison.results))
    axes = figure.subplots()
    names = [r.entry.name for r in comparison.results]
    for i, result in enumerate(comparison.results):
        y = len(names) - 1 - i
        if result.draw_rms is not None:
            low, middle, high = result.draw_rms
            axes.plot([low, high], [y, y], color=CART[1], linewidth=5.0, alpha=0.35, solid_capstyle="butt")
            axes.plot([middle], [y], "|", color=CART[1], markersize=9, markeredgewidth=1.5)
        for of in result.effects.values():
            good = of.success
            axes.plot(
                [min(of.rms, farthest)],
                [y],
                "o" if good else "x",
                color=CART[2] if good else MARK,
                markersize=3.5,
                alpha=0.75,
            )
    axes.plot([], [], color=CART[1], linewidth=5.0, alpha=0.35, label="drawn drives, 5–95 %")
    axes.plot([], [], "o", color=CART[2], markersize=3.5, label="a left-out effect, success")
    axes.plot([], [], "x", color=MARK, markersize=3.5, label="a left-out effect, failure")
    axes.set(xscale="log", yticks=range(len(names)), yticklabels=names[::-1], xlabel="rms $x_r - x_2$ [mm]")
    axes.xaxis.set_minor_formatter("{x:g}")
    axes.tick_params(axis="x", which="minor", labelsize=7)
    legend_above(axes)
    return figure


MARKERS = "osD^vPX*"
# share of the largest vibration under which a controller is as good as still
_CALM = 1e-4
# Okabe and Ito's colours without the yellow, which is too pale for a marker
_SAFE = ("#000000", "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#6b6b6b")


@styled
def plot_overview(results: Sequence[Result], named: Sequence[Result]) -> Figure:
    """Draw tracking error over the gain margin and over the vibration left in the dwells, one point a controller.

    Parameters
    ----------
    results
        All controllers.
    named
        Those with a colour and a marker of their own; the others are small and grey. What does not settle is hollow.
    """
    figure = new_figure(4.4)
    margin, vibration = figure.subplots(1, 2, sharey=True)
    margins = {r.entry.name: _gain_margin(r) for r in results}
    # what vibrates less than this is calm, and zero has no logarithm
    calm = _CALM * max((v for r in results if np.isfinite(v := r.nominal.vibration)), default=0.0)
    for r in sorted(results, key=lambda r: r in named):
        i = next((i for i, n in enumerate(named) if n is r), None)
        colour = "#b0b0b0" if i is None else _SAFE[i % len(_SAFE)]
        look_of: dict[str, Any] = {
            "marker": "o" if i is None else MARKERS[i % len(MARKERS)],
            "color": colour,
            "markerfacecolor": colour if r.nominal.success else "none",
            "markersize": 3.5 if i is None else 8.0,
            "linestyle": "none",
        }
        for axes, x in ((margin, margins[r.entry.name]), (vibration, max(r.nominal.vibration, calm))):
            if np.isfinite(x) and np.isfinite(r.nominal.rms):
                axes.plot(x, r.nominal.rms, **look_of)
        if i is not None:
            vibration.plot([], [], **look_of, label=r.entry.name)
    vibration.plot([], [], "o", color="#b0b0b0", markersize=3.5, label="others")
    vibration.plot([], [], "o", color=COMMAND, markerfacecolor="none", markersize=5, label="hollow: does not settle")
    margin.set(xlabel="gain margin →", ylabel="rms $x_r - x_2$ [mm]")
    vibration.set(
        xlabel=f"← vibration in the dwells [V mm], at least {calm:.0e}" if calm else "vibration in the dwells [V mm]"
    )
    margin.set_yscale("log")
    if any(np.isfinite(v) and v > 0.0 for v in margins.values()):
        margin.set_xscale("log")
    if calm:
        vibration.set_xscale("log")
    for axis in (margin.yaxis, margin.xaxis):
        axis.set_major_formatter("{x:g}")
        if axis.get_scale() == "log":
            # no closer, so that the numbers of several decades stay apart
            axis.set_minor_locator(LogLocator(subs=(2.0, 3.0, 5.0)))
        axis.set_minor_formatter("{x:g}")
    margin.tick_params(axis="both", which="minor", labelsize=7)
    figure.legend(loc="outside lower center", ncols=5)
    return figure


def _gain_margin(result: Result) -> float:
    """Return the margin on the simulated rig, which every controller has; the linear one where none was tried."""
    if result.on_rig is not None:
        return result.on_rig.gain_margin
    return np.nan if result.margins is None else result.margins.gain_margin


@styled
def plot_overlay(pairs: Sequence[tuple[Recording, Recording]]) -> Figure:
    """Draw recorded P-control runs over their predictions in the loop: x2, x1 and the command.

    Parameters
    ----------
    pairs
        (measured, simulated) on the same instants; where an encoder lost counts or froze, its panel is shaded.
    """
    figure = new_figure(1.75 * len(pairs) + 0.3, width=9.5)
    panels = figure.subplots(len(pairs), 3, sharex="row", squeeze=False)
    known: dict[str, Any] = {}
    for (measured, simulated), row in zip(pairs, panels, strict=True):
        for axes, channel in zip(row, ("x2", "x1", "u"), strict=True):
            if channel != "u":
                shade_faults(axes, measured, f"encoder_{channel[1]}")
                axes.plot(measured.t, measured.xr, color=COMMAND, linewidth=0.8, linestyle=":", label="reference")
            axes.plot(measured.t, getattr(measured, channel), color=REFERENCE, linewidth=1.5, label="measured")
            axes.plot(simulated.t, getattr(simulated, channel), color=CART[2], linewidth=1.0, label="predicted")
            axes.set_ylabel("u [V]" if channel == "u" else f"$x_{channel[1]}$ [mm]")
            handles, labels = axes.get_legend_handles_labels()
            known.update(zip(labels, handles, strict=True))
        row[0].set_title(f"{measured.excitation}", loc="left", fontsize=8.5)
    for axes in panels[-1]:
        axes.set_xlabel("time [s]")
    figure.legend(known.values(), known.keys(), loc="outside upper right", ncols=5)
    return figure

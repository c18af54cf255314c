"""How the values of handout 3.2 were collected from the step responses."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from identification.plots import style
from identification.plots.style import new_figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from flexdrive_gym.recording import FloatArray
    from flexdrive_gym.units import Units
    from identification.half_periods import AmplitudeReading
    from identification.step_response import HandoutResult


@styled
def plot_steady_state(result: HandoutResult) -> Figure:
    """Plot averaged half-periods with vss marked, and the line vss(u0) of Eq. (5) that gives bT and dT.

    Parameters
    ----------
    result
        Of :func:`identification.step_response.identify_by_handout`.

    Returns
    -------
    matplotlib.figure.Figure
    """
    shown = result.steady[::-1]  # largest amplitude on top
    figure = new_figure(max(3.4, 1.9 * len(shown)))
    grid = figure.add_gridspec(len(shown), 2, width_ratios=[3, 2])
    axes = figure.add_subplot(grid[0, 0])
    for i, reading in enumerate(shown):
        if i:
            axes = figure.add_subplot(grid[i, 0], sharex=axes)
        _half_period(axes, reading, result.units)
        axes.tick_params(labelbottom=i == len(shown) - 1)
    axes.set_xlabel("time since reversal [s]")
    _line(figure.add_subplot(grid[:, 1]), result)
    return figure


def _half_period(axes: Axes, reading: AmplitudeReading, units: Units) -> None:
    axes.axvspan(*reading.window, color=style.SHADE, linewidth=0.0, zorder=0)
    for cart, v in ((1, reading.v1), (2, reading.v2)):
        axes.plot(reading.t, v, color=style.CART[cart], linewidth=1.0, label=f"$v_{cart}$")
    axes.axhline(reading.vss, color=style.MARK, linestyle="--", linewidth=1.0)
    error = "" if reading.vss_error is None else f" ± {units.text(reading.vss_error, 'mm/s', 2)}"
    axes.annotate(
        f"$v_{{ss}}$ = {units.text(reading.vss, 'mm/s')}{error}",
        (reading.window[1], 0.35 * reading.vss),
        ha="right",
        va="center",
        color=style.MARK,
    )
    axes.set_title(f"±{units.text(reading.amplitude, 'V')}, mean of {reading.n_averaged} half-periods", loc="left")
    style.label_in(axes.yaxis, "velocity [mm/s]", units)
    axes.legend(loc="lower center", ncols=2)


def _line(axes: Axes, result: HandoutResult) -> None:
    bT, dT, units = result["bT"], result["dT"], result.units
    largest = 1.08 * max(reading.amplitude for reading in result.amplitudes)
    u0 = np.array([dT, largest])
    axes.plot(u0, (u0 - dT) / bT, color=style.COMMAND, label="Eq. (5)")
    used, stopped = result.steady, [reading for reading in result.amplitudes if not reading.steady]
    axes.errorbar(
        [reading.amplitude for reading in used],
        [reading.vss for reading in used],
        yerr=[2.0 * (reading.vss_error or 0.0) for reading in used],
        fmt="o",
        color=style.MARK,
        capsize=3.0,
        label="$v_{ss}$ ± 2 std. errors",
    )
    if stopped:
        axes.plot(
            [reading.amplitude for reading in stopped],
            [reading.vss for reading in stopped],
            "o",
            markerfacecolor="white",
            color=style.REFERENCE,
            label="carts stop, left out",
        )
    axes.set_xlim(0.0, largest)
    axes.set_ylim(bottom=0.0)
    axes.set_title(f"$b_T$ = {units.text(bT, 'V s/mm')},  $d_T$ = {units.text(dT, 'V', 3)}", loc="left")
    style.label_in(axes.xaxis, "amplitude $u_0$ [V]", units)
    style.label_in(axes.yaxis, "steady velocity $v_{ss}$ [mm/s]", units)
    axes.legend(loc="upper left")


@styled
def plot_time_constant(result: HandoutResult) -> Figure:
    """Plot the 63 % construction on v1, and the rigid drive with Coulomb friction that has the same reading."""
    reading = result.time_constant
    average = next(a for a in result.steady if a.amplitude == reading.amplitude)
    figure = new_figure(3.4)
    axes = figure.subplots()
    for half in average.half_periods:
        axes.plot(half.t, style.moving_mean(half.v1, 11), color=style.REFERENCE, alpha=0.3, linewidth=0.5)
    axes.plot(average.t, average.v1, color=style.CART[1], label="$v_1$, mean of half-periods")
    t = np.linspace(0.0, average.t[-1], 2000)
    first_order = reading.vss * (1.0 - 2.0 * np.exp(-reading.p_read * t))
    axes.plot(t, first_order, color=style.REFERENCE, linestyle="--", label="first order, $p$ as read")
    axes.plot(
        t,
        _rigid_drive(t, reading.vss, reading.amplitude, result["dT"], reading.p_corrected),
        color=style.COMMAND,
        linestyle=":",
        linewidth=1.6,
        label="rigid drive with Coulomb friction, $p$ corrected",
    )
    axes.axhline(reading.vss, color=style.REFERENCE, linewidth=0.8)
    axes.axhline(-reading.vss, color=style.REFERENCE, linewidth=0.8)
    axes.plot([0.0, reading.t63, reading.t63], [reading.level, reading.level, -1.75 * reading.vss],
              color=style.MARK, linewidth=1.0)  # fmt: skip
    axes.plot(reading.t63, reading.level, "o", color=style.MARK)
    simulated = (
        f"\n$p$ = {reading.p_consistent:.1f} 1/s for two carts, simulated" if reading.p_consistent is not None else ""
    )
    axes.annotate(
        f"63.2 % of the range at $t_{{63}}$ = {1e3 * reading.t63:.1f} ms\n"
        f"$p$ = {reading.p_read:.1f} 1/s as read\n"
        f"$p$ = {reading.p_corrected:.1f} 1/s corrected for Coulomb friction ({reading.bias_percent:.0f} % bias){simulated}",
        (reading.t63, reading.level),
        xytext=(60, -14),
        textcoords="offset points",
        va="top",
        color=style.MARK,
        arrowprops={"arrowstyle": "-", "color": style.MARK, "linewidth": 0.7},
    )
    end = min(float(average.t[-1]), max(8.0 * reading.t63, 4.0 / reading.p_corrected, 0.25))
    axes.set_xlim(0.0, end)
    axes.set_ylim(-1.75 * reading.vss, max(1.3 * reading.vss, 1.05 * float(average.v1[average.t < end].max())))
    axes.set_title(f"Time constant at ±{result.units.text(reading.amplitude, 'V')}", loc="left")
    axes.set_xlabel("time since reversal [s]")
    style.label_in(axes.yaxis, "velocity $v_1$ [mm/s]", result.units)
    axes.legend(loc="lower right")
    return figure


def _rigid_drive(t: FloatArray, vss: float, u0: float, dT: float, p: float) -> FloatArray:
    """Return the reversal of a rigid drive: u0 + dT acts until v = 0, u0 - dT after it."""
    before = vss * (u0 + dT) / (u0 - dT)
    t0 = np.log(2.0 * u0 / (u0 + dT)) / p
    falling = before - (before + vss) * np.exp(-p * t)
    return np.where(t < t0, falling, vss * (1.0 - np.exp(-p * (t - t0))))


@styled
def plot_damped_frequency(result: HandoutResult) -> Figure:
    """Plot averaged v2 with its trend, and the vibration about the trend with the extrema used."""
    reading = result.vibration
    figure = new_figure(4.2)
    top, bottom = figure.subplots(2, 1, sharex=True)
    top.plot(reading.t, reading.v2, color=style.CART[2], label="$v_2$, mean of half-periods")
    top.plot(reading.t, reading.trend, color=style.REFERENCE, linestyle="--", label="trend: centre of mass")
    style.label_in(top.yaxis, "velocity [mm/s]", result.units)
    top.set_title(f"Second cart at ±{result.units.text(reading.amplitude, 'V')}", loc="left")
    top.legend(loc="lower right")

    deviation = reading.v2 - reading.trend
    bottom.plot(reading.t, deviation, color=style.CART[2])
    bottom.axhline(0.0, color=style.REFERENCE, linewidth=0.8)
    bottom.plot(reading.peak_times, reading.peak_values, "o", color=style.MARK, label="extrema used")
    for axes in (top, bottom):
        for t in reading.peak_times:
            axes.axvline(t, color=style.MARK, linewidth=0.6, linestyle=":")
    largest = float(np.abs(reading.peak_values).max())
    for t0, t1 in zip(reading.peak_times[:-1], reading.peak_times[1:], strict=True):
        bottom.annotate("", (t0, 1.4 * largest), (t1, 1.4 * largest), arrowprops={"arrowstyle": "<->"})
        bottom.annotate(
            f"{1e3 * (t1 - t0):.0f} ms",
            (0.5 * (t0 + t1), 1.45 * largest),
            ha="center",
            va="bottom",
            fontsize=8,
        )
    error = f" ± {reading.standard_error:.2g}" if reading.standard_error is not None else ""
    bottom.set_title(rf"$\omega_d = \pi/\Delta t$ = {reading.omega_d:.3g}{error} rad/s", loc="left")
    bottom.set_ylim(-1.8 * largest, 1.9 * largest)
    bottom.set_xlim(0.0, float(reading.t[-1]))
    bottom.set_xlabel("time since reversal [s]")
    style.label_in(bottom.yaxis, "$v_2$ - trend [mm/s]", result.units)
    bottom.legend(loc="lower right")
    return figure


@styled
def plot_zeta_iteration(result: HandoutResult) -> Figure:
    """Plot how ζ, ωn and k settle over the passes of Steps 1-6."""
    table = result.iterations
    passes = np.arange(1, len(table) + 1)
    figure = new_figure(2.4)
    zeta, omega_n, k = figure.subplots(1, 3)
    marker = "o-" if len(table) <= 30 else "-"
    zeta.plot(passes, [row.zeta for row in table], marker, color=style.REFERENCE, markersize=4, label="assumed")
    zeta.plot(
        passes,
        [row.zeta_of_poles for row in table],
        marker,
        color=style.MARK,
        markersize=4,
        label="of the poles",
    )
    zeta.legend(loc="best")
    omega_n.plot(passes, [row.omega_n for row in table], marker, color=style.MARK, markersize=4)
    k.plot(passes, [row.k / result.units.one("V/mm") for row in table], marker, color=style.MARK, markersize=4)
    last = table[-1]
    for axes, title, unit in (
        (zeta, rf"$\zeta$ = {last.zeta_of_poles:.4g}", r"$\zeta$ [ ]"),
        (omega_n, rf"$\omega_n$ = {last.omega_n:.4g} rad/s", r"$\omega_n$ [rad/s]"),
        (k, f"$k$ = {result.units.text(last.k, 'V/mm')}", result.units.name("$k$ [V/mm]")),
    ):
        axes.set_title(title, loc="left")
        axes.set_xlabel("pass of Steps 2-6")
        axes.set_ylabel(unit)
        axes.xaxis.get_major_locator().set_params(integer=True)
    return figure

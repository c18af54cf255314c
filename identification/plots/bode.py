"""Bode plots against measured points (handout 3.4) and pole-zero maps (Figure 3)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.ticker import MultipleLocator

from flexdrive_gym.units import LAB, Units
from identification.frequency_response import response_with_friction, theoretical_response
from identification.plots import style
from identification.plots.style import new_figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from flexdrive_gym import Drive, LinearDrive
    from flexdrive_gym.recording import BoolArray, FloatArray
    from identification.frequency_response import CartResponse, FrequencyTable, Response


@styled
def plot_bode(
    linear: LinearDrive,
    table: FrequencyTable | None,
    drive: Drive | None = None,
    amplitude: float | None = None,
) -> tuple[Figure, Figure]:
    """Plot sG1 and sG2 of Eq. (7) with the measured points, in two figures (handout 3.4).

    Parameters
    ----------
    linear
        Drive whose theoretical response is drawn, at 1000 points from 10^-1 to 10^3 rad/s.
    table
        Measured points, drawn with their 95 % intervals; ``None`` for theory alone.
    drive
        Adds, dashed, its response with Coulomb friction as describing function.
    amplitude
        Of the command for that [V]; the table's median by default.

    Returns
    -------
    tuple of matplotlib.figure.Figure
        Cart 1, cart 2.

    Raises
    ------
    ValueError
        If ``drive`` is given and neither ``amplitude`` nor a table tells the amplitude of the command.
    """
    theory = theoretical_response(linear)
    friction: Response | None = None
    if drive is not None:
        if amplitude is None and table is None:
            raise ValueError("amplitude: friction's effect depends on it; got None without a table. Pass it in V.")
        if amplitude is None and table is not None:
            amplitude = table.amplitude
        friction = response_with_friction(drive, theory.omega, amplitude or 0.0)
    units = table.units if table is not None else LAB if drive is None else drive.units
    label = f"with Coulomb friction at ±{units.text(amplitude or 0.0, 'V', 3)} (describing function)"
    return (
        _bode_of_cart(1, theory, table, friction, label, units),
        _bode_of_cart(2, theory, table, friction, label, units),
    )


def _bode_of_cart(
    cart: int,
    theory: Response,
    table: FrequencyTable | None,
    friction: Response | None,
    label: str,
    units: Units,
) -> Figure:
    figure = new_figure(5.0)
    gain, phase = figure.subplots(2, 1, sharex=True)
    colour = style.CART[cart]
    one = units.one("mm/s/V")
    gain.plot(theory.omega, theory.gain(cart) / one, color=colour, label=f"$sG_{cart}$, Eq. (7)")
    phase.plot(theory.omega, theory.phase(cart), color=colour)
    if friction is not None:
        moving = friction.gain(cart) > 0.0
        gain.plot(friction.omega, _gaps(friction.gain(cart) / one, moving), "--", color=style.COMMAND, label=label)
        phase.plot(friction.omega, friction.phase(cart), "--", color=style.COMMAND)
    if table is not None:
        _points(gain, phase, table, cart, one)
    gain.set_xscale("log")
    gain.set_yscale("log")
    gain.set_xlim(1e-1, 1e3)
    gain.set_ylim(*(limit / one for limit in _gain_limits(theory.gain(cart), table, cart)))
    gain.set_title(f"Velocity of cart {cart}", loc="left")
    gain.set_ylabel(units.name(f"gain $v_{cart}/u$ [(mm/s)/V]"))
    gain.legend(loc="lower left")
    phase.yaxis.set_major_locator(MultipleLocator(45.0 if cart == 1 else 90.0))
    phase.set_xlabel("frequency [rad/s]")
    phase.set_ylabel(f"phase $\\angle(v_{cart}/u)$ [deg]")
    return figure


def _gaps(values: FloatArray, shown: BoolArray) -> FloatArray:
    return np.where(shown, values, np.nan)


def _gain_limits(theory: FloatArray, table: FrequencyTable | None, cart: int) -> tuple[float, float]:
    """Return the gain axis: all of theory, and measured points down to a tenth of that."""
    values = [theory[np.isfinite(theory)]]
    if table is not None:
        cells = [row.cart(cart) for row in table.rows]
        values.append(np.array([cell.gain for cell in cells if cell is not None and not cell.flag]))
    everything = np.concatenate(values)
    return 0.6 * float(everything[everything > 0.0].min()), 2.0 * float(everything.max())


def _points(gain: Axes, phase: Axes, table: FrequencyTable, cart: int, one: float) -> None:
    known: list[tuple[float, CartResponse]] = []
    flagged: list[tuple[float, CartResponse]] = []
    for row in table.rows:
        cell = row.cart(cart)
        if cell is not None:
            (flagged if cell.flag else known).append((row.omega, cell))
    if known:
        omega = [w for w, _ in known]
        style_of_points: dict[str, Any] = {
            "fmt": "o",
            "color": style.MARK,
            "markersize": 4.0,
            "capsize": 2.0,
            "elinewidth": 0.8,
        }
        gain.errorbar(
            omega,
            [cell.gain / one for _, cell in known],
            yerr=_bars([cell.gain for _, cell in known], [cell.gain_ci for _, cell in known]) / one,
            label="measured, 95 %",
            **style_of_points,
        )
        phases = [cell.phase_deg or 0.0 for _, cell in known]
        intervals = [cell.phase_ci or (0.0, 0.0) for _, cell in known]
        phase.errorbar(omega, phases, yerr=_bars(phases, intervals), **style_of_points)
    visible = [(w, cell.gain / one) for w, cell in flagged if cell.gain > 0.0]
    if visible:
        gain.plot(
            *zip(*visible, strict=True),
            "o",
            markerfacecolor="white",
            color=style.REFERENCE,
            markersize=4.0,
            label="below encoder resolution or noise",
        )


def _bars(values: list[float], intervals: list[tuple[float, float]]) -> FloatArray:
    """Return distances below and above, shape (2, n), without infinite ones."""
    centre, ends = np.array(values), np.array(intervals)
    bars = np.abs(np.vstack([centre - ends[:, 0], ends[:, 1] - centre]))
    return np.where(np.isfinite(bars), bars, 0.0)


@styled
def plot_pole_zero(linear: LinearDrive) -> Figure:
    """Plot the pole-zero maps of collocated and non-collocated control (Figure 3 of the handout).

    Parameters
    ----------
    linear
        The two-cart drive.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    ValueError
        For a rigid drive, which has no non-collocated map.
    """
    if linear.rigid:
        raise ValueError("linear: Figure 3 needs both carts; got a rigid drive (m2 = inf). Pass a drive with m2 and k.")
    figure = new_figure(3.6)
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    _map(left, linear, linear.zeros("x1"), r"(a) collocated: $G_1 = x_1/u$")
    _map(right, linear, linear.zeros("x2"), r"(b) non-collocated: $G_2 = x_2/u$")
    # C > 0 puts a fast real zero far to the left, which would squeeze everything else
    reach_x = 1.35 * max(linear.p, float(np.abs(linear.oscillatory_poles.real).max()), 0.25 * linear.omega_n)
    reach_y = 1.35 * max(float(np.abs(linear.oscillatory_poles.imag).max()), float(np.abs(linear.zeros("x1")).max()))
    left.set_xlim(-reach_x, 0.25 * reach_x)
    left.set_ylim(-reach_y, reach_y)
    left.set_ylabel("imaginary part [rad/s]")
    return figure


def _map(axes: Axes, linear: LinearDrive, zeros: np.ndarray, title: str) -> None:
    axes.axhline(0.0, color=style.REFERENCE, linewidth=0.8)
    axes.axvline(0.0, color=style.REFERENCE, linewidth=0.8)
    poles = linear.poles
    axes.plot(poles.real, poles.imag, "x", color=style.CART[1], markersize=8, markeredgewidth=1.8, label="poles")
    if len(zeros):
        axes.plot(zeros.real, zeros.imag, "o", color=style.CART[2], markersize=8, markerfacecolor="none",
                  markeredgewidth=1.5, label="zeros")  # fmt: skip
    marks = [
        (-linear.p, 0.0, f"$-p$ = {-linear.p:.3g}", (0, 10), "center"),
        (0.0, 0.0, "integrator", (5, 8), "left"),
    ]
    if linear.omega_d > 0.0:
        text = f"$\\omega_n$ = {linear.omega_n:.3g} rad/s\n$\\zeta$ = {linear.zeta:.2g}"
        marks.append((-linear.zeta * linear.omega_n, linear.omega_d, text, (-10, 0), "right"))
    for x, y, text, offset, side in marks:
        axes.annotate(text, (x, y), xytext=offset, textcoords="offset points", ha=side, va="center", fontsize=8)
    axes.set_title(title, loc="left")
    axes.set_xlabel("real part [1/s]")
    axes.legend(loc="lower left")

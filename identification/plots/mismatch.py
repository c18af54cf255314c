"""What a diagnosis shows: measured against simulated before and after, and maps of the missing force."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from identification.mismatch.force.maps import UNITS, variables
from identification.plots import style
from identification.plots.style import legend_above, moving_mean, new_figure, shade_faults, styled
from identification.signals import velocities

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from flexdrive_gym import Recording
    from flexdrive_gym.recording import BoolArray, FloatArray
    from identification.mismatch.answer.finding import Curve
    from identification.mismatch.force.maps import Map
    from identification.mismatch.force.missing_force import MissingForce

_BEFORE = "#a4541c"
_AFTER = "#1f5a99"
_MOST_POINTS = 5000
_SMOOTH_S = 0.01


def _channels(recording: Recording) -> list[tuple[str, FloatArray, BoolArray]]:
    """Return what is compared: velocities of an open loop, the fed-back position of a closed one."""
    if recording.closed_loop:
        name = recording.excitation.feedback or "x2"
        x = getattr(recording, name)
        if x is not None:
            return [(name, x, recording.valid(name))]
    found = []
    for i, v in enumerate(velocities(recording), start=1):
        place = f"v{i}" if getattr(recording, f"v{i}") is not None else f"x{i}"
        found.append((f"v{i}", v, recording.valid(place)))  # type: ignore[arg-type]
    return found


def _smooth(recording: Recording, y: FloatArray) -> FloatArray:
    return moving_mean(y, round(_SMOOTH_S / recording.sample_time) | 1)


def telling_window(measured: Recording, before: Recording, after: Recording) -> tuple[float, float]:
    """Return the stretch of a recording in which the two simulations differ most in error [s, s].

    Two periods of a periodic command, at most three seconds.
    """
    f, h = measured.excitation.frequency, measured.sample_time
    length = float(np.clip(2.0 / f if f > 0.0 else 2.0, 0.25, 3.0))
    n = min(round(length / h), measured.n)
    gain = np.zeros(measured.n)
    simulated = zip(_channels(measured), _channels(before), _channels(after), strict=False)
    for (_, y, valid), (_, b, _), (_, a, _) in simulated:
        worse, better = (_smooth(measured, y - model) for model in (b, a))
        # a stretch of faulty counts shows nothing
        gain += np.where(valid, worse**2 - better**2, -float(np.mean(y**2)))
    total = np.cumsum(gain)
    start = int(np.argmax(total[n - 1 :] - np.concatenate(([0.0], total[:-n]))))
    return float(measured.t[start]), float(measured.t[start + n - 1])


@styled
def plot_before_after(
    measured: Recording,
    before: Recording,
    after: Recording,
    *,
    titles: tuple[str, str] = ("before", "after"),
    window: tuple[float, float] | None = None,
) -> Figure:
    """Plot measured against simulated, without the named physics on the left and with it on the right.

    Parameters
    ----------
    measured
        A recorded run: velocities are compared; the fed-back position for P-control.
    before, after
        Simulations on the same instants.
    titles
        Headings of the two columns.
    window
        Stretch that is shown [s, s]; by default the one in which the two differ most.
    """
    units = measured.units
    measured, before, after = (replace(run, units=units).in_rig_units() for run in (measured, before, after))
    begin, end = window or telling_window(measured, before, after)
    real = _channels(measured)
    part = (measured.t >= begin) & (measured.t <= end)
    figure = new_figure(1.9 + 1.6 * len(real))
    panels = figure.subplots(
        len(real) + 1, 2, sharex=True, sharey="row", squeeze=False, height_ratios=[*[2.0] * len(real), 1.3]
    )
    for column, (title, run) in enumerate(zip(titles, (before, after), strict=True)):
        unit = units.name("mm/s")
        for row, ((name, y, valid), (_, model, _)) in enumerate(zip(real, _channels(run), strict=False)):
            axes, error = panels[row, column], panels[-1, column]
            cart, unit = int(name[1]), units.name("mm" if name[0] == "x" else "mm/s")
            rms = float(np.sqrt(np.mean((y - model)[valid] ** 2)))
            axes.plot(
                measured.t[part], _smooth(measured, y)[part], color=style.COMMAND, linewidth=0.9, label="measured"
            )
            axes.plot(run.t[part], model[part], color=style.CART[cart], linewidth=1.7, alpha=0.85, label="simulated")
            shade_faults(axes, measured, f"encoder_{cart}")
            axes.set_title(f"{title}: ${name[0]}_{name[1]}$ off by {rms:.2g} {unit} rms", loc="left")
            difference = np.where(valid, _smooth(measured, y - model), np.nan)
            error.plot(
                measured.t[part],
                difference[part],
                color=style.CART[cart],
                linewidth=1.1,
                label=f"${name[0]}_{name[1]}$",
            )
            if column == 0:
                axes.set_ylabel(f"${name[0]}_{name[1]}$ [{unit}]")
                error.set_ylabel(f"error [{unit}]")
        panels[-1, column].axhline(0.0, color=style.COMMAND, linewidth=0.6)
        panels[-1, column].set_xlabel("time $t$ [s]")
        panels[-1, column].set_xlim(begin, end)
    # above the titles, where it covers no data
    figure.legend(*panels[0, 1].get_legend_handles_labels(), loc="outside upper right", ncols=2)
    return figure


def _points(forces: Sequence[MissingForce], m: Map) -> tuple[FloatArray, FloatArray]:
    cart = int(m.where[-1]) - 1
    x = np.concatenate([variables(f)[m.variable][f.usable[cart]] for f in forces])
    g = np.concatenate([f.g[cart][f.usable[cart]] for f in forces])
    every = max(1, len(x) // _MOST_POINTS)
    return x[::every], g[::every]


def _draw_map(axes: Axes, m: Map, colour: str, label: str) -> None:
    axes.fill_between(
        m.centre, m.mean - 2.0 * m.band, m.mean + 2.0 * m.band, color=colour, alpha=0.25, linewidth=0.0, zorder=3
    )
    axes.plot(m.centre, m.mean, color=colour, linewidth=1.6, marker=".", markersize=4.0, label=label, zorder=4)


def _label(m: Map) -> str:
    name = f"${m.variable[0]}_{m.variable[1]}$" if len(m.variable) == 2 else f"${m.variable}$"
    return f"{name.replace('δ', chr(92) + 'delta')} [{m.units.name(UNITS[m.variable])}]"


@styled
def plot_telling_map(
    measured: Sequence[MissingForce],
    before: Map,
    left: Sequence[MissingForce] = (),
    supply: Map | None = None,
    after: Map | None = None,
) -> Figure:
    """Plot the missing force against the variable that tells most: before on the left, what remains on the right.

    Parameters
    ----------
    measured, before
        Missing forces, and the map that tells most, with its band of two standard errors over the recordings.
    left, after
        The same of what remains; none where nothing was named, then there is one panel.
    supply
        The force that the named physics supplies, from the diagnosed drive's own runs.
    """
    figure = new_figure(3.1)
    stages = [("force the base model leaves missing", measured, before, _BEFORE)]
    if after is not None:
        stages[0] = ("before: force the base model leaves missing", measured, before, _BEFORE)
        stages.append(("after: what remains with the named physics", left, after, _AFTER))
    panels = figure.subplots(1, len(stages), sharex=True, sharey=True, squeeze=False)[0]
    reach = 0.0
    for axes, (title, forces, m, colour) in zip(panels, stages, strict=True):
        x, g = _points(forces, m)
        axes.plot(x, g, linestyle="none", marker=".", markersize=1.2, color=style.MEASURED, alpha=0.35, zorder=1)
        _draw_map(axes, m, colour, "mean ± 2 s.e.")
        axes.axhline(0.0, color=style.COMMAND, linewidth=0.7)
        axes.set_title(title, loc="left", pad=16.0)
        axes.set_xlabel(_label(m))
        reach = max(reach, float(np.quantile(np.abs(g), 0.97)), float(np.nanmax(np.abs(m.mean))))
        edge = np.quantile(x, (0.002, 0.998))
        axes.set_xlim(float(edge[0]), float(edge[1]))
    if supply is not None:
        panels[0].plot(
            supply.centre,
            supply.mean,
            color=_AFTER,
            linestyle="--",
            linewidth=1.5,
            label="supplied by the named physics",
            zorder=5,
        )
    panels[0].set_ylim(-1.15 * reach, 1.15 * reach)
    panels[0].set_ylabel(f"missing on cart {before.where[-1]} [{before.units.command}]")
    for axes in panels:
        legend_above(axes)
    return figure


@styled
def plot_maps(before: Sequence[Map], after: Sequence[Map] = ()) -> Figure:
    """Plot small maps of every missing force against everything it could depend on, before and, if given, after."""
    wheres = sorted({m.where for m in before})
    names = [n for n in UNITS if any(m.variable == n for m in before)]
    figure = new_figure(0.55 + 1.3 * len(wheres))
    panels = figure.subplots(len(wheres), len(names), sharey="row", sharex="col", squeeze=False)
    place = {(w, n): panels[i, j] for i, w in enumerate(wheres) for j, n in enumerate(names)}
    remaining = {(m.where, m.variable): m for m in after}
    for b in before:
        a = remaining.get((b.where, b.variable))
        axes = place[b.where, b.variable]
        _draw_map(axes, b, _BEFORE, "before")
        share = f"{max(b.explained, 0.0):.0%}"
        if a is not None:
            _draw_map(axes, a, _AFTER, "after")
            share += f" → {max(a.explained, 0.0):.0%}"
        for line in axes.lines:
            line.set(marker="", linewidth=1.1)
        axes.axhline(0.0, color=style.COMMAND, linewidth=0.5)
        axes.set_title(share, fontsize=8.0)
        axes.tick_params(labelsize=6.5)
        axes.locator_params(axis="x", nbins=3)
        if b.where == wheres[-1]:
            axes.set_xlabel(_label(b), fontsize=8.0)
    for i, w in enumerate(wheres):
        panels[i, 0].set_ylabel(f"missing on\ncart {w[-1]} [{before[0].units.command}]", fontsize=8.0)
    return figure


@styled
def plot_curve(curve: Curve, where: str) -> Figure:
    """Plot a missing force that is a free function of one variable, with its band of two standard errors."""
    figure = new_figure(2.4)
    axes = figure.subplots()
    low, high = curve.force - 2.0 * curve.band, curve.force + 2.0 * curve.band
    axes.fill_between(curve.at, low, high, color=_BEFORE, alpha=0.25, linewidth=0.0)
    axes.plot(curve.at, curve.force, color=_BEFORE, linewidth=1.6, marker=".", markersize=4.0)
    axes.axhline(0.0, color=style.COMMAND, linewidth=0.7)
    axes.set_xlabel(f"{curve.variable} [{curve.unit}]")
    place = "in the spring" if where == "spring" else f"on {where.replace('_', ' ')}"
    axes.set_ylabel(f"force missing\n{place} [{curve.command}]")
    axes.margins(x=0.01)
    return figure

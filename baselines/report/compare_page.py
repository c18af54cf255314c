"""The page of ``flexdrive compare``."""

from __future__ import annotations

import numpy as np

from baselines.compare import Comparison, Result, headline, run_controller
from baselines.controllers import SAMPLE_TIME_S
from baselines.report import control_plots as plots
from baselines.report.design_page import cell
from baselines.report.page import Section, render
from baselines.shares import Share
from flexdrive_gym import LinearController, __version__
from flexdrive_gym.references import handout_trajectory


def build_compare_page(comparison: Comparison) -> str:
    """Return the page as HTML: tables of all measures, tracking errors, robustness, margins."""
    sections = [_tracking(comparison), _margins(comparison), _robustness(comparison), _who(comparison)]
    drawn = sum(c.group == "draw" for c in comparison.cases)
    effects = sum(c.group == "effect" for c in comparison.cases)
    subtitle = (
        f"{len(comparison.results)} controllers, {comparison.duration:g} s of the handout's "
        f"trajectory, {drawn} drives drawn from the "
        f"identified covariance (seed {comparison.seed}), {effects} left-out effects"
    )
    return render(
        title=f"Controllers on {comparison.drive.name}",
        subtitle=subtitle,
        summary=headline(comparison),
        sections=sections,
        footer=f"Made by flexdrive {__version__}: flexdrive compare.",
    )


def share_cell(share: Share | None) -> str:
    """Return a share with its interval for a table."""
    return "–" if share is None else f"{share.value:.1%} ({share.low:.1%} … {share.high:.1%})"


def _tracking(comparison: Comparison) -> Section:
    section = Section("Tracking on the identified drive", "tracking")
    section.table(
        ("controller", "feedback", "rms e [mm]", "peak |e| [mm]", "settling [s]", "overshoot [%]", "vibration [V mm]",
         "rms u [V]", "peak |u| [V]", "at the limit", "success"),
        [
            (r.entry.name, r.entry.feedback, cell(m.rms), cell(m.peak), cell(m.settling, 2), cell(m.overshoot, 2),
             cell(m.vibration, 2), cell(m.effort), cell(m.effort_peak), f"{m.limited:.1%}", "yes" if m.success else "no")
            for r in comparison.results for m in [r.nominal]
        ],
    )  # fmt: skip
    section.text(
        f"Settling: longest time after a move until x2 stays within {comparison.tolerance:g} mm; a "
        "dash where it never does before the "
        "next move. Success: stable and settled in every dwell. Vibration: mean energy in the second half of the dwells."
    )
    t = np.asarray(np.arange(round(comparison.duration / SAMPLE_TIME_S) + 1) * SAMPLE_TIME_S, dtype=np.float64)
    xr = handout_trajectory(t)
    runs = {}
    for r in comparison.results:
        period = getattr(r.entry.controller, "sample_time", SAMPLE_TIME_S)
        if period == SAMPLE_TIME_S:
            states, u = run_controller(r.entry.controller, [comparison.drive], xr, SAMPLE_TIME_S)[0]
            runs[r.entry.name] = (xr - states[2 if comparison.drive.carts == 2 else 0], u)
    if len(runs) == len(comparison.results):
        section.figure(plots.plot_errors(comparison, runs, t), "Tracking error; the band is the tolerance.")
    return section


def _margins(comparison: Comparison) -> Section:
    section = Section("Margins of the linear loop", "margins")
    rows = [(r, r.margins) for r in comparison.results if r.margins is not None]
    section.table(
        ("controller", "stable", "crossover [rad/s]", "GM", "GM by trial", "PM [deg]", "delay margin [ms]", "by trial [ms]",
         "disk margin", "peak |S|", "smallest disturbance rejection [V/mm]"),
        [
            (r.entry.name, "yes" if m.stable else "no", cell(m.crossover), cell(m.gain_margin, 4), *_trial(r, "gain"),
             cell(m.phase_margin_deg), cell(1e3 * m.delay_margin, 4), *_trial(r, "delay"), cell(m.disk_margin),
             cell(m.sensitivity_peak), cell(m.stiffness))
            for r, m in rows
        ],
    )  # fmt: skip
    black = [r for r in comparison.results if r.margins is None and r.empirical is not None]
    if black:
        section.table(
            ("black box", "GM by trial", "delay margin by trial [ms]"),
            [(r.entry.name, *_trial(r, "gain"), *_trial(r, "delay")) for r in black],
        )
    linear = {r.entry.name: r.entry.controller for r, _m in rows if isinstance(r.entry.controller, LinearController)}
    if linear:
        section.figure(plots.plot_loops(comparison.drive, linear), "Loop gains, broken at the command.")
        section.figure(
            plots.plot_trade(comparison),
            "What accuracy costs: tracking error with friction over the linear loop's disk margin.",
        )
    return section


def _trial(result: Result, what: str) -> tuple[str]:
    if result.empirical is None:
        return ("–",)
    value = result.empirical.gain_margin if what == "gain" else 1e3 * result.empirical.delay_margin
    return (cell(value, 4),)


def _robustness(comparison: Comparison) -> Section:
    section = Section("Robustness", "robustness")
    section.table(
        ("controller", "stable over draws", "success over draws", "rms e, 5 % [mm]", "50 %", "95 %", "effects survived"),
        [
            (r.entry.name, share_cell(r.stable_draws), share_cell(r.draws), *_quantiles(r),
             "–" if r.effect_share is None else f"{r.effect_share.hits} of {r.effect_share.trials}")
            for r in comparison.results
        ],
    )  # fmt: skip
    section.figure(
        plots.plot_robustness(comparison),
        "rms error over the drawn drives (bars) and with each left-out effect (dots).",
    )
    effects = [c.name for c in comparison.cases if c.group == "effect"]
    if effects:
        section.heading("rms error with each left-out effect at its typical size [mm]")
        section.table(
            ("effect", *(r.entry.name for r in comparison.results)),
            [(name, *(_effect(r, name) for r in comparison.results)) for name in effects],
        )
        section.text("* : does not settle within the tolerance; ** : leaves the travel or grows.")
    return section


def _quantiles(result: Result) -> tuple[str, str, str]:
    if result.draw_rms is None:
        return "–", "–", "–"
    low, middle, high = result.draw_rms
    return cell(low), cell(middle), cell(high)


def _effect(result: Result, name: str) -> str:
    of = result.effects[name]
    return f"{cell(of.rms)}{'' if of.success else '*' if of.stable else '**'}"


def _who(comparison: Comparison) -> Section:
    section = Section("The controllers", "who")
    section.items(
        [
            f"{r.entry.name}: {r.entry.title or 'black box'}" + "".join(f" ({n})" for n in r.entry.notes)
            for r in comparison.results
        ]
        + [f"{name}: left out, {reason}" for name, reason in comparison.skipped.items()]
    )
    return section

"""The page of ``flexdrive compare``."""

from __future__ import annotations

from collections.abc import Sequence

from baselines.compare import Comparison, Result, behaviour, headline, shortlist, summarise
from baselines.compare.comparison import instants
from baselines.compare.shortlist import MOST
from baselines.compare.tables import BY_TRIAL, LINEAR, loop_words, overview_table, share_cell, with_friction
from baselines.evaluation.rollout import run_many
from baselines.report import control_plots as plots
from baselines.report.design_page import cell
from baselines.report.learnt_section import behaviour_section, statistics_section
from baselines.report.page import Section, render
from flexdrive_gym import LinearController, __version__
from flexdrive_gym.references import handout_trajectory
from flexdrive_gym.units import Units, in_rig_units


def build_compare_page(comparison: Comparison) -> str:
    """Return the page as HTML, in the rig's units: a picture and the controllers that matter most; everything else is folded."""
    units = comparison.drive.units
    told = in_rig_units(comparison, units)
    chosen = shortlist(told)
    sections = [_overview(told, chosen, units), _errors(comparison, chosen, told.tolerance), _tracking(told, units)]
    if any(r.entry.learnt for r in comparison.results):
        summaries, improvements = summarise(comparison)
        found = behaviour(comparison)
        sections += [
            statistics_section(comparison, summaries, improvements),
            behaviour_section(comparison, summaries, found),
        ]
    sections += [_margins(comparison, told), _robustness(told, chosen, units), _who(told)]
    for section in sections[2:]:
        section.folded = True
    drawn = sum(c.group == "draw" and c.handout for c in comparison.cases)
    effects = sum(c.group == "effect" for c in comparison.cases)
    others = f", and {', '.join(comparison.references)}" if comparison.references else ""
    subtitle = (
        f"{len(comparison.results)} controllers, {told.duration:g} s of the handout's trajectory{others}; {drawn} drives "
        f"drawn from the identified covariance (seed {comparison.seed}), {effects} left-out effects; one rig at 1 kHz"
    )
    return render(
        title=f"Controllers on “{comparison.drive.name}”",
        subtitle=subtitle,
        summary=headline(comparison),
        sections=sections,
        footer=f"Made by flexdrive {__version__}: flexdrive compare.",
    )


def _overview(told: Comparison, chosen: Sequence[Result], units: Units) -> Section:
    section = Section("Overview", "overview", units=units)
    tried = any(r.on_rig is not None for r in told.results)
    section.figure(
        plots.plot_overview(told.results, chosen),
        "Tracking error against the gain margin"
        + (", simulated with friction," if tried else " of the linear loop")
        + " and against the vibration left in the dwells. One point a controller: low is accurate, right on the left panel "
        "is robust, left on the right panel is calm. Hollow points do not settle in every dwell.",
    )
    table = overview_table(told.drive, told.limit, chosen)
    section.table(table.columns, table.rows)
    rest = len(told.results) - len(chosen)
    section.text(
        ("The best of each kind, P-control as the yardstick, and the best learnt policy. " if rest else "")
        + f"Settles: x2 stays within {told.tolerance:.4g} {units.length} in every dwell; beside it the share of drawn drives on "
        "which it does. Vibration: mean energy in the second half of the dwells. "
        + (f"The other {rest} controllers are in the tables below." if rest else "")
    )
    return section


def _errors(comparison: Comparison, chosen: Sequence[Result], tolerance: float) -> Section:
    """Return the tracking error over time of some controllers, whose measures and tolerance are in the rig's units."""
    units = comparison.drive.units
    section = Section("Tracking error", "errors", units=units)
    t = instants(comparison.duration)
    xr = handout_trajectory(t)
    runs = {}
    for r in chosen:
        run = run_many(r.entry.controller, [comparison.drive], xr)[0]
        e = xr - run[2 if comparison.drive.carts == 2 else 0]
        runs[r.entry.name] = (e / units.one("mm"), run[4] / units.one("V"))
    section.figure(
        plots.plot_errors(chosen, tolerance, runs, t / units.one("s"), units),
        "Tracking error, all on one scale that cuts off the largest; the band is the tolerance.",
    )
    return section


def _tracking(told: Comparison, units: Units) -> Section:
    section = Section("All controllers: tracking on the identified drive", "tracking", units=units)
    section.table(
        ("controller", "feedback", "acts every [ms]", "rms e [mm]", "peak |e| [mm]", "settling [s]", "overshoot [%]",
         "vibration [V mm]", "rms u [V]", "peak |u| [V]", "at the limit", "success"),
        [
            (r.entry.name, r.entry.feedback, f"{1e3 * r.entry.period:g}", cell(m.rms), cell(m.peak), cell(m.settling, 2),
             cell(m.overshoot, 2), cell(m.vibration, 2), cell(m.effort), cell(m.effort_peak), f"{m.limited:.1%}",
             "yes" if m.success else "no")
            for r in told.results for m in [r.nominal]
        ],
    )  # fmt: skip
    section.text(
        f"Settling: longest time after a move until x2 stays within {told.tolerance:.4g} {units.length}; a dash where it never "
        "does before the next move. Success: stable and settled in every dwell. A controller slower than the rig's 1 ms holds "
        "its command between its samples."
    )
    return section


_RIG = 1.001e-3


def _margins(comparison: Comparison, told: Comparison) -> Section:
    units = comparison.drive.units
    section = Section("Margins", "margins", units=units)
    rows = [(r, r.margins) for r in told.results if r.margins is not None]
    section.table(
        ("controller", "loop", "crossover [rad/s]", "GM linear", "by trial", "PM linear [deg]", "delay linear [ms]",
         "by trial [ms]", "disk margin", "peak |S|", "smallest disturbance rejection [V/mm]", "GM with friction",
         "delay with friction [ms]"),
        [
            (r.entry.name, loop_words(r, units), cell(m.crossover), cell(m.gain_margin, 4), *_trial(r, "gain"),
             cell(m.phase_margin_deg), cell(1e3 * m.delay_margin, 4), *_trial(r, "delay"), cell(m.disk_margin),
             cell(m.sensitivity_peak), cell(m.stiffness), *_on_rig(r))
            for r, m in rows
        ],
    )  # fmt: skip
    black = [r for r in told.results if r.margins is None and r.on_rig is not None]
    if black:
        section.table(
            ("black box", "loop", "GM with friction", "delay with friction [ms]"),
            [(r.entry.name, loop_words(r, units), *_on_rig(r)) for r in black],
        )
    section.text(f"{LINEAR} {BY_TRIAL}")
    section.text(f"{with_friction(units)} A dash: no limit below 200 times the gain, or a second of delay.")
    fast = [r for r, _m in rows if r.entry.period <= _RIG] or [r for r, _m in rows]
    linear = {r.entry.name: r.entry.loop for r in fast if isinstance(r.entry.loop, LinearController)}
    if linear:
        section.figure(plots.plot_loops(comparison.drive, linear), "Loop gains, broken at the command.")
    return section


def _trial(result: Result, what: str) -> tuple[str]:
    if result.empirical is None:
        return ("–",)
    value = result.empirical.gain_margin if what == "gain" else 1e3 * result.empirical.delay_margin
    return (cell(value, 4),)


def _on_rig(result: Result) -> tuple[str, str]:
    of = result.on_rig
    return ("–", "–") if of is None else (cell(of.gain_margin, 4), cell(1e3 * of.delay_margin, 4))


def _robustness(comparison: Comparison, chosen: Sequence[Result], units: Units) -> Section:
    section = Section("Robustness", "robustness", units=units)
    section.table(
        ("controller", "stable over draws", "success over draws", "rms e, 5 % [mm]", "50 %", "95 %", "effects survived"),
        [
            (r.entry.name, share_cell(r.stable_draws), share_cell(r.draws), *_quantiles(r),
             "–" if r.effect_share is None else f"{r.effect_share.hits} of {r.effect_share.trials}")
            for r in comparison.results
        ],
    )  # fmt: skip
    section.figure(
        plots.plot_robustness(comparison, 1e3 / units.one("mm")),
        "rms error over the drawn drives (bars) and with each left-out effect (dots).",
    )
    effects = [c.name for c in comparison.cases if c.group == "effect"]
    if effects:
        section.heading("rms error with each left-out effect at its typical size [mm]")
        # of seeds the middle one; beside the first eight, eight at a time
        rest = [r for r in (g.middle for g in comparison.groups) if r not in chosen]
        for k, shown in enumerate([chosen, *(rest[i : i + MOST] for i in range(0, len(rest), MOST))]):
            section.table(
                ("effect", *(r.entry.name for r in shown)),
                [(name, *(_effect(r, name) for r in shown)) for name in effects],
                folded="" if k == 0 else ", ".join(r.entry.name for r in shown),
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
        _described(comparison.results) + [f"{k}: left out, {reason}" for k, reason in comparison.skipped.items()]
    )
    return section


def _described(results: Sequence[Result]) -> list[str]:
    return [
        f"{r.entry.name}: {r.entry.title or 'black box'}" + "".join(f" ({n})" for n in r.entry.notes) for r in results
    ]

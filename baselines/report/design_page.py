"""The page of ``flexdrive design``."""

from __future__ import annotations

from math import isfinite

from baselines.compare.tables import LINEAR
from baselines.lab.lab4_study import Lab4Study, Line, verdict
from baselines.report import control_plots as plots
from baselines.report.page import Section, render
from flexdrive_gym import __version__


def build_design_page(study: Lab4Study) -> str:
    """Return the page as HTML: every value, the specification, Bode, step, disturbance and tracking plots."""
    sections = [_values(study), _loops(study), _responses(study), _tracking(study)]
    s = study.specification
    subtitle = (
        f"crossover {s.crossover:g} rad/s, GM ≥ {s.gain_margin:g}, PM ≥ {s.phase_margin_deg:g}°; discretised at 1 kHz"
    )
    return render(
        title=f"Lab 4 on {study.drive.name}",
        subtitle=subtitle,
        summary=verdict(study),
        sections=sections,
        footer=f"Made by flexdrive {__version__}: flexdrive design.",
    )


def cell(value: float, digits: int = 3) -> str:
    """Return a number for a table; a dash where there is none."""
    return f"{value:.{digits}g}" if isfinite(value) else "–"


def _mm(value: float) -> str:
    """Return a length with two decimals [mm], without a minus before zero."""
    return f"{round(value, 2) + 0.0:.2f}"


def _values(study: Lab4Study) -> Section:
    section = Section("Values of the design", "values")
    hand, refined = study.by_hand.table(), study.refined.table()
    section.table(
        ("value", "unit", "by the handout's rule", "refined on the sampled loop"),
        [(name, unit, cell(value, 4), cell(refined[name][0], 4)) for name, (value, unit) in hand.items()],
    )
    section.text(
        "The stages p_x2, notch and lead carry the handout's values; the integral and lab4 carry the "
        "refined ones where these meet the "
        "specification."
    )
    section.heading("Specification")
    section.table(
        ("line", "demanded", "handout's rule", "missed by", "refined", "missed by"),
        [
            (b.name, a.demand, a.reached, _missed(a), b.reached, _missed(b))
            for a, b in zip(study.hand_lines, study.lines, strict=False)
        ],
    )
    return section


def _missed(line: Line) -> str:
    return "met" if line.met else line.missed_by


def _loops(study: Lab4Study) -> Section:
    section = Section("Loops", "loops")
    loops = {s.name: s.design.controller for s in study.stages if s.name != "lab4"}
    section.figure(
        plots.plot_loops(study.drive, loops, study.specification.crossover),
        "Loop gains of the sampled loops. lab4 adds feed-forward only, so its loop is that of integral.",
    )
    section.table(
        ("stage", "linear loop", "crossover [rad/s]", "GM linear", "PM linear [deg]", "delay linear [ms]", "disk margin",
         "peak |S|", "smallest disturbance rejection [V/mm]"),
        [
            (s.name, "stable" if s.margins.stable else "unstable", cell(s.margins.crossover), cell(s.margins.gain_margin),
             cell(s.margins.phase_margin_deg), cell(1e3 * s.margins.delay_margin), cell(s.margins.disk_margin),
             cell(s.margins.sensitivity_peak), cell(s.margins.stiffness))
            for s in study.stages
        ],
    )  # fmt: skip
    section.text(LINEAR + " What friction adds is on the pages of flexdrive compare, as GM with friction.")
    return section


def _responses(study: Lab4Study) -> Section:
    section = Section("Step and disturbance", "responses")
    feedback = [s for s in study.stages if s.name != "lab4"]
    section.figure(
        plots.plot_stage_responses(feedback, "step", "command step of 10 mm, linear drive without limit"),
        "Command step. Feed-forward is for smooth references and left out here; with it a step kicks.",
    )
    section.figure(
        plots.plot_stage_responses(feedback, "disturbance", "disturbance of 1 V at the command, linear drive"),
        "Disturbance step: without integral action x2 stays away.",
    )
    section.figure(
        plots.plot_stage_responses(feedback, "rig disturbance", "disturbance of 1 V at the command, with friction"),
        "The same with friction, which holds part of the disturbance from rest.",
    )
    limits = list(study.stages[0].rig_steps)
    section.table(
        ("stage", "rise [s]", "overshoot [%]", "1 V: peak [mm]", "1 V: final [mm]", "1 V, friction: peak [mm]",
         "final [mm]", *(f"step at ±{v:g} V: rise [s]; overshoot [%]" for v in limits)),
        [
            (s.name, cell(s.step.rise), cell(s.step.overshoot), cell(s.disturbance.peak), _mm(s.disturbance.final),
             cell(s.rig_disturbance.peak), _mm(s.rig_disturbance.final),
             *(f"{cell(s.rig_steps[v].rise)}; {cell(s.rig_steps[v].overshoot)}" for v in limits))
            for s in study.stages
        ],
    )  # fmt: skip
    return section


def _tracking(study: Lab4Study) -> Section:
    section = Section("Tracking", "tracking")
    section.table(
        ("stage", "limit [V]", "rms e [mm]", "peak |e| [mm]", "settling [s]", "overshoot [%]", "vibration [V mm]", "rms u [V]",
         "peak |u| [V]", "at the limit"),
        [
            (s.name, f"{limit:g}", cell(m.rms), cell(m.peak), cell(m.settling, 2), cell(m.overshoot, 2), cell(m.vibration, 2),
             cell(m.effort), cell(m.effort_peak), f"{m.limited:.1%}")
            for s in study.stages for limit, m in s.tracking.items()
        ],
    )  # fmt: skip
    section.text(
        "Settling: longest time after a move until x2 stays within 2 mm; a dash where it never does before the next move."
    )
    peak = max(m.effort_peak for s in study.stages for m in s.tracking.values())
    least = min(study.stages[0].tracking)
    if peak < least:
        section.text(
            f"No stage asks for more than {peak:.1f} V on this trajectory, so the runs at every limit "
            "are the same; the steps above tell "
            "the limits apart."
        )
    for stage in study.stages:
        section.figure(plots.plot_tracking(stage), f"{stage.name}: positions, tracking error, command.")
    return section

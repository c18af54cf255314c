"""The page of ``flexdrive design``."""

from __future__ import annotations

from math import isfinite

from baselines.compare.tables import LINEAR
from baselines.evaluation.metrics import TOLERANCE_MM
from baselines.lab.lab4_study import DISTURBANCE_V, STEP_MM, Lab4Study, Line, verdict
from baselines.report import control_plots as plots
from baselines.report.page import Section, render
from flexdrive_gym import __version__
from flexdrive_gym.units import Units, in_rig_units


def build_design_page(study: Lab4Study) -> str:
    """Return the page as HTML: every value, the specification, Bode, step, disturbance and tracking plots; in the rig's units."""
    units = study.drive.units
    told = in_rig_units(study, units)
    sections = [_values(study), _loops(study, told), _responses(told, units), _tracking(told, units)]
    s = told.specification
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


def _rest(value: float, units: Units) -> str:
    """Return a rest to 0.01 mm of the lab, without a minus before zero; ``value`` is the rig's."""
    least = 0.01 / units.one("mm")
    return f"{round(value / least) * 0.01 + 0.0:.2f}" if units.lab else cell(round(value / least) * least + 0.0)


def _values(study: Lab4Study) -> Section:
    section, units = Section("Values of the design", "values"), study.drive.units
    hand, refined = study.by_hand.table(), study.refined.table()
    section.table(
        ("value", "unit", "by the handout's rule", "refined on the sampled loop"),
        [
            (name, units.name(unit), cell(value / units.one(unit), 4), cell(refined[name][0] / units.one(unit), 4))
            for name, (value, unit) in hand.items()
        ],
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


def _loops(study: Lab4Study, told: Lab4Study) -> Section:
    section = Section("Loops", "loops", units=study.drive.units)
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
            for s in told.stages
        ],
    )  # fmt: skip
    section.text(LINEAR + " What friction adds is on the pages of flexdrive compare, as GM with friction.")
    return section


def _responses(study: Lab4Study, units: Units) -> Section:
    section = Section("Step and disturbance", "responses", units=units)
    step, pushed = units.text(STEP_MM, "mm"), units.text(DISTURBANCE_V, "V")
    feedback = [s for s in study.stages if s.name != "lab4"]
    section.figure(
        plots.plot_stage_responses(feedback, "step", f"command step of {step}, linear drive without limit"),
        "Command step. Feed-forward is for smooth references and left out here; with it a step kicks.",
    )
    section.figure(
        plots.plot_stage_responses(feedback, "disturbance", f"disturbance of {pushed} at the command, linear drive"),
        "Disturbance step: without integral action x2 stays away.",
    )
    section.figure(
        plots.plot_stage_responses(
            feedback, "rig disturbance", f"disturbance of {pushed} at the command, with friction"
        ),
        "The same with friction, which holds part of the disturbance from rest.",
    )
    limits = list(study.stages[0].rig_steps)
    section.table(
        ("stage", "rise [s]", "overshoot [%]", f"{pushed}: peak [mm]", f"{pushed}: final [mm]", f"{pushed}, friction: peak [mm]",
         "final [mm]", *(f"step at ±{v:.4g} {units.command}: rise [s]; overshoot [%]" for v in limits)),
        [
            (s.name, cell(s.step.rise), cell(s.step.overshoot), cell(s.disturbance.peak), _rest(s.disturbance.final, units),
             cell(s.rig_disturbance.peak), _rest(s.rig_disturbance.final, units),
             *(f"{cell(s.rig_steps[v].rise)}; {cell(s.rig_steps[v].overshoot)}" for v in limits))
            for s in study.stages
        ],
    )  # fmt: skip
    return section


def _tracking(study: Lab4Study, units: Units) -> Section:
    section = Section("Tracking", "tracking", units=units)
    section.table(
        ("stage", "limit [V]", "rms e [mm]", "peak |e| [mm]", "settling [s]", "overshoot [%]", "vibration [V mm]", "rms u [V]",
         "peak |u| [V]", "at the limit"),
        [
            (s.name, f"{limit:.4g}", cell(m.rms), cell(m.peak), cell(m.settling, 2), cell(m.overshoot, 2), cell(m.vibration, 2),
             cell(m.effort), cell(m.effort_peak), f"{m.limited:.1%}")
            for s in study.stages for limit, m in s.tracking.items()
        ],
    )  # fmt: skip
    section.text(
        f"Settling: longest time after a move until x2 stays within {units.text(TOLERANCE_MM, 'mm')}; a dash where it never does "
        "before the next move."
    )
    peak = max(m.effort_peak for s in study.stages for m in s.tracking.values())
    least = min(study.stages[0].tracking)
    if peak < least:
        section.text(
            f"No stage asks for more than {peak:.3g} {units.command} on this trajectory, so the runs at every limit "
            "are the same; the steps above tell "
            "the limits apart."
        )
    for stage in study.stages:
        section.figure(plots.plot_tracking(stage), f"{stage.name}: positions, tracking error, command.")
    return section

"""The page of ``flexdrive stability``."""

from __future__ import annotations

from collections.abc import Mapping

from baselines.report import control_plots as plots
from baselines.report.discussion import measure_p_control
from baselines.report.page import Section, render
from baselines.stability_study import StabilityStudy
from baselines.uncertainty import interval_in_words, reasons
from flexdrive_gym import Recording, __version__
from identification.plots import plot_pole_zero, plot_recording

_TITLES = {
    "2.1": "stable",
    "2.2": "critically stable",
    "2.3": "unstable",
    "2.4": "collocated, at the unstable gain",
}


def build_stability_page(study: StabilityStudy) -> str:
    """Return the page as HTML: limits, root loci, pole-zero maps, the four runs with and without friction."""
    sections = [_limits(study)]
    if any(p.draws for p in study.predicted.values()):
        sections.append(_intervals(study))
    if study.drive.carts == 2:
        sections += [_theory(study), _amplitude(study)]
    sections.append(_runs(study, study.runs, "Experiments 2.1–2.4, simulated", "runs"))
    if study.runs_without_friction:
        sections.append(_runs(study, study.runs_without_friction, "The same without Coulomb friction", "smooth"))
    return render(
        title=f"Stability limit of {study.drive.name}",
        subtitle="P-control from x1 and from x2, handout 2.1–2.4",
        summary=study.explanation,
        sections=sections,
        footer=f"Made by flexdrive {__version__}: flexdrive stability.",
    )


def _cell(value: float | None) -> str:
    return "none below 10" if value is None else f"{value:.4g}"


def _limits(study: StabilityStudy) -> Section:
    section = Section("Limits", "limits")
    rows = [
        (name, _cell(v.critical_gain_linear), _cell(v.critical_gain_margin), _cell(v.critical_gain_simulated),
         "–" if v.vibration is None else f"{v.vibration:.3g}", "–" if v.phase_margin_deg is None else f"{v.phase_margin_deg:.1f}")
        for name, v in study.limits.items()
    ]  # fmt: skip
    at = next(iter(study.limits.values())).at_gain
    section.table(
        ("feedback", "critical gain by Routh, linear [V/mm]", "by the gain margin, linear [V/mm]",
         "simulated with friction, one move [V/mm]", "vibration, linear [rad/s]", f"PM linear at {at:g} V/mm [deg]"),
        rows,
    )  # fmt: skip
    section.text(
        "Linear: of the continuous loop without friction; the gain margin at 1 V/mm is the critical gain. Simulated with "
        "friction, counts and limit: the least gain at which x2 swings more than 25 mm in the last six of twelve seconds "
        "after one move."
    )
    if study.drive.carts == 2:
        section.table(
            ("as a student finds it, from x2, simulated", "critical gain [V/mm]"),
            [("with friction", _cell(study.student)), ("without friction", _cell(study.student_without_friction))],
        )
    return section


def _intervals(study: StabilityStudy) -> Section:
    section = Section("What another run of this rig may do", "intervals")
    drawn = [p for p in study.predicted.values() if p.draws]
    section.text(
        f"Every figure was computed on {drawn[0].draws} drives drawn from the covariance over recordings and from the "
        "friction that differs between runs. The interval holds 95 % of them."
    )
    section.table(
        ("figure", "of the drive", "median", "95 % interval", "unit", "extrapolated"),
        [
            (p.name, _cell(p.value), _cell(p.median), interval_in_words(p), p.unit, "yes" if p.extrapolated else "no")
            for p in drawn
        ],
    )
    for sentence in reasons(drawn):
        section.text(sentence)
    return section


def _theory(study: StabilityStudy) -> Section:
    section = Section("Poles, zeros and root loci", "loci")
    linear = study.drive.linear
    section.figure(plot_pole_zero(linear), "Pole-zero maps of both feedbacks.")
    critical = {name: v.critical_gain_linear for name, v in study.limits.items()}
    section.figure(
        plots.plot_root_loci(linear, critical),
        "Closed-loop poles as Kp rises from 0 (dark) upwards (light). Left: the zeros hold the complex pair in the left half. "
        "Right: it crosses the imaginary axis at the critical gain.",
    )
    return section


def _amplitude(study: StabilityStudy) -> Section:
    section = Section("Why friction raises the limit", "amplitude")
    routh = study.limits["x2"].critical_gain_linear
    if routh is None or not study.curve:
        section.text("The linear loop has no limit below 10 V/mm.")
        return section
    section.text(
        "Dry friction takes the same force from a small vibration as from a large one, so it damps "
        "the small one more: for a velocity "
        "of amplitude V it acts as a damper 4d/(πV). The gain at which a vibration just survives "
        "therefore depends on its size. Beyond "
        "the command limit's reach the loop cannot feed the vibration any more."
    )
    lines = {"student, with friction": study.student} if study.student is not None else {}
    section.figure(
        plots.plot_amplitude(study.curve, [(s.amplitude, kp) for s, kp in study.tried], routh, lines),
        "Gain at which a vibration of x2 keeps its size: harmonic balance and trials on the simulated drive.",
    )
    section.table(
        ("amplitude [mm]", "frequency [rad/s]", "harmonic balance [V/mm]", "simulated [V/mm]"),
        [(f"{s.amplitude:.3g}", f"{s.omega:.4g}", f"{s.factor:.4g}", f"{kp:.4g}") for s, kp in study.tried],
    )
    return section


def _linearly(study: StabilityStudy, feedback: str, gain: float) -> str:
    limit = study.limits[feedback].critical_gain_linear if feedback in study.limits else None
    return "stable" if limit is None or gain < limit else "unstable"


def _runs(study: StabilityStudy, runs: Mapping[str, Recording], title: str, anchor: str) -> Section:
    section = Section(title, anchor)
    rows = []
    for number, run in runs.items():
        if run.x2 is not None:
            m = measure_p_control(run)
            rows.append(
                (number, _TITLES[number], m.feedback, f"{m.gain:.4g}", f"{m.error_rms:.2f}", f"{m.error_peak:.1f}",
                 f"{m.dwell_error:.2f}", f"{m.vibration:.2f}", _linearly(study, m.feedback, m.gain),
                 "yes" if m.unstable else "no")
            )  # fmt: skip
    if rows:
        section.table(
            ("section", "case", "feedback", "Kp [V/mm]", "rms e [mm]", "peak |e| [mm]", "|e| in dwells [mm]",
             "x2 swing in dwells [mm]", "linear loop", "simulated: grows"),
            rows,
        )  # fmt: skip
    for number, run in runs.items():
        section.figure(plot_recording(run), f"{number} {_TITLES[number]}: {run.excitation}.")
    return section

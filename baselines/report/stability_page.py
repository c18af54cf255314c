"""The page of ``flexdrive stability``."""

from __future__ import annotations

from collections.abc import Mapping

from baselines.lab.stability_study import StabilityStudy
from baselines.lab.uncertainty import PREDICTION_COLUMNS, limit_in_words, prediction_rows, reasons
from baselines.loop_analysis.stability_limit import LARGEST_GAIN
from baselines.report import control_plots as plots
from baselines.report.discussion import measure_p_control
from baselines.report.page import Section, render
from flexdrive_gym import Recording, __version__
from flexdrive_gym.units import in_rig_units
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


def _cell(value: float | None, one: float = 1.0) -> str:
    return limit_in_words(None if value is None else value / one)


def _limits(study: StabilityStudy) -> Section:
    section, units, one = Section("Limits", "limits"), study.drive.units, study.drive.units.one("V/mm")
    rows = [
        (name, _cell(v.critical_gain_linear), _cell(v.critical_gain_margin), _cell(v.critical_gain_simulated),
         "–" if v.vibration is None else f"{v.vibration:.3g}", "–" if v.phase_margin_deg is None else f"{v.phase_margin_deg:.1f}")
        for name, v in ((name, in_rig_units(limit, units)) for name, limit in study.limits.items())
    ]  # fmt: skip
    at = next(iter(study.limits.values())).at_gain
    section.table(
        ("feedback", units.name("critical gain by Routh, linear [V/mm]"), units.name("by the gain margin, linear [V/mm]"),
         units.name("simulated with friction, one move [V/mm]"), "vibration, linear [rad/s]",
         f"PM linear at {units.text(at, 'V/mm')} [deg]"),
        rows,
    )  # fmt: skip
    section.text(
        f"No limit: none below {units.text(LARGEST_GAIN, 'V/mm')}. Linear: of the continuous loop without friction; the gain "
        f"margin at a gain of 1 {units.name('V/mm')} is the critical gain. Simulated with friction, counts and limit: the least "
        f"gain at which x2 swings more than {units.text(25.0, 'mm')} in the last six of twelve seconds after one move."
    )
    if study.drive.carts == 2:
        section.table(
            ("as a student finds it, from x2, simulated", units.name("critical gain [V/mm]")),
            [
                ("with friction", _cell(study.student, one)),
                ("without friction", _cell(study.student_without_friction, one)),
            ],
        )
    return section


def _intervals(study: StabilityStudy) -> Section:
    section = Section("What another run of this rig may do", "intervals")
    drawn, units = [p for p in study.predicted.values() if p.draws], study.drive.units
    section.text(
        f"Every figure was computed on {drawn[0].draws} drives drawn from the covariance over recordings and from the "
        "friction that differs between runs. The interval holds 95 % of them."
    )
    section.table(PREDICTION_COLUMNS, prediction_rows(drawn, units))
    for sentence in reasons(drawn, units):
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
    section, units = Section("Why friction raises the limit", "amplitude"), study.drive.units
    one = units.one("V/mm")
    routh = study.limits["x2"].critical_gain_linear
    if routh is None or not study.curve:
        section.text(f"The linear loop has no limit below {study.drive.units.text(LARGEST_GAIN, 'V/mm')}.")
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
        [
            units.name(name)
            for name in (
                "amplitude [mm]",
                "frequency [rad/s]",
                "harmonic balance [V/mm]",
                "simulated [V/mm]",
            )
        ],
        [
            (f"{s.amplitude / units.one('mm'):.3g}", f"{s.omega:.4g}", f"{s.factor / one:.4g}", f"{kp / one:.4g}")
            for s, kp in study.tried
        ],
    )
    return section


def _linearly(study: StabilityStudy, feedback: str, gain: float) -> str:
    limit = study.limits[feedback].critical_gain_linear if feedback in study.limits else None
    return "stable" if limit is None or gain < limit else "unstable"


def _runs(study: StabilityStudy, runs: Mapping[str, Recording], title: str, anchor: str) -> Section:
    section, units = Section(title, anchor), study.drive.units
    rows = []
    for number, run in runs.items():
        if run.x2 is not None:
            m = measure_p_control(run)
            rows.append(
                (number, _TITLES[number], m.feedback, f"{m.gain / units.one('V/mm'):.4g}",
                 *(f"{x / units.one('mm'):.3g}" for x in (m.error_rms, m.error_peak, m.dwell_error, m.vibration)),
                 _linearly(study, m.feedback, m.gain),
                 "yes" if m.unstable else "no")
            )  # fmt: skip
    if rows:
        section.table(
            [units.name(name) for name in (
                "section", "case", "feedback", "Kp [V/mm]", "rms e [mm]", "peak |e| [mm]", "|e| in dwells [mm]",
                "x2 swing in dwells [mm]", "linear loop", "simulated: grows",
            )],
            rows,
        )  # fmt: skip
    for number, run in runs.items():
        section.figure(plot_recording(run), f"{number} {_TITLES[number]}: {run.excitation}.")
    return section

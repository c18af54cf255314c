"""The teaching page of ``flexdrive compare``: the handout's question answered from runs, with moving pictures."""

from __future__ import annotations

from math import isfinite

from baselines.compare import Comparison
from baselines.compare.lesson import Demonstration, Lesson, lesson
from baselines.compare.tables import LINEAR, doing, with_friction
from baselines.report import learnt_plots as plots
from baselines.report.animation import animated
from baselines.report.design_page import cell
from baselines.report.discussion import collocation, effect_of_gain, measure_p_control
from baselines.report.page import Section, render
from flexdrive_gym import __version__
from flexdrive_gym.units import Units, in_rig_units

# a swing in the dwells that the table tells beside what the loop does in the end
LEAST_TOLD_MM = 1.0


def build_teaching_page(comparison: Comparison) -> str:
    """Return the page as HTML.

    Raises
    ------
    ValueError
        For a rigid drive, which has no non-collocated control.
    """
    run = lesson(comparison)
    found = in_rig_units(run, run.drive.units)
    return render(
        title="What does the gain do in non-collocated control? What does collocated control buy and cost?",
        subtitle=f"The questions of Lab 3, answered on “{found.drive.name}”: every figure below is simulated on this drive, with "
        "its friction, encoder counts and command limit, along the handout's trajectory.",
        summary=_short(found),
        sections=[_answers(run), _table(found, run.drive.units), _pictures(run), _responses(run), _beyond(found)],
        footer=f"Made by flexdrive {__version__}: flexdrive compare.",
    )


def _short(found: Lesson) -> list[str]:
    """Answer in three sentences, figures as they are given."""
    mm = found.drive.units.length
    low, high, beyond = (found.find(f"P(x2), {name}") for name in ("stable", "critical", "unstable"))
    collocated = found.find("P(x1), collocated")
    said = []
    if low and high:
        said.append(
            f"More gain from x2 changes the error left in the dwells from {low.parts.offset:.2g} to {high.parts.offset:.2g} "
            f"{mm}, and the vibration there from {low.vibration:.2g} to {high.vibration:.2g} {mm}"
            + ("; a little more and it grows." if beyond and not beyond.measures.stable else ".")
        )
    if collocated:
        word = "does not grow" if collocated.measures.stable else "grows"
        said.append(
            f"The same gain from x1 {word}, and leaves x2 {collocated.parts.offset:.2g} {mm} from where it should be, as the "
            "loop does not measure x2."
        )
    best = min(found.shown, key=lambda d: d.measures.rms if d.measures.stable else float("inf"))
    said.append(f"Of all shown here {best.name} tracks best: {best.measures.rms:.3g} {mm} rms.")
    return said


def _answers(found: Lesson) -> Section:
    section = Section("The answers", "answers")
    measures = [measure_p_control(run) for run in found.recordings.values()]
    section.heading("What is the effect of changing the gain in non-collocated control?")
    for sentence in effect_of_gain(measures, found.drive, found.limit):
        section.text(sentence)
    section.heading("What does collocated control buy, and what does it cost?")
    for sentence in collocation(measures, found.drive):
        section.text(sentence)
    return section


def _table(found: Lesson, units: Units) -> Section:
    section = Section("Comparison", "table", units=units)
    rows: list[tuple[str, ...]] = [
        ("law", *(d.law for d in found.shown)),
        ("reads", *(d.reads for d in found.shown)),
        ("acts every [ms]", *(f"{1e3 * d.period:g}" for d in found.shown)),
        ("linear loop", *(_linear(d) for d in found.shown)),
        ("simulated with friction", *(_does(d, units) for d in found.shown)),
        ("rms of xr - x2 [mm]", *(f"{d.measures.rms:.3g}" for d in found.shown)),
        ("peak [mm]", *(f"{d.measures.peak:.3g}" for d in found.shown)),
        ("left at the end of the dwells [mm]", *(f"{d.parts.offset:.3g}" for d in found.shown)),
        ("swing of x2 in the dwells [mm]", *(f"{d.vibration:.3g}" for d in found.shown)),
        ("rms of u [V]", *(f"{d.measures.effort:.3g}" for d in found.shown)),
        ("GM linear", *(cell(d.margins.gain_margin) if d.margins else "–" for d in found.shown)),
        ("delay linear [ms]", *(cell(1e3 * d.margins.delay_margin) if d.margins else "–" for d in found.shown)),
        ("GM with friction", *(_gain(d) for d in found.shown)),
        ("delay with friction [ms]", *(_delay(d) for d in found.shown)),
    ]
    section.table(("", *(d.name for d in found.shown)), [(units.label(head), *cells) for head, *cells in rows])
    section.text(
        LINEAR
        + " design.html has the same figures. A dash: there is no limit, the loop is unstable, or it is not linear."
    )
    section.text(with_friction(units) + " A dash: it fails as it is.")
    section.text(
        "A limit cycle is what is left of the vibration in the last six of twelve seconds after one move, peak to peak, of the "
        "cart that swings most; the swing in the dwells is along the handout's trajectory, which moves again every second."
    )
    return section


def _linear(d: Demonstration) -> str:
    if d.margins is None:
        return "not linear"
    return "stable" if d.margins.stable else "unstable"


def _does(d: Demonstration, units: Units) -> str:
    """Say what the simulated loop does; a swing along the trajectory is told even where it dies out after a single move."""
    said = doing(d.measures.stable, d.swing, units)
    if said == "grows" or d.vibration < LEAST_TOLD_MM / units.one("mm"):
        return said
    return f"swings {d.vibration:.2g} {units.length} in the dwells; after one move {said}"


def _gain(d: Demonstration) -> str:
    if d.on_rig is None:
        return "–"
    return f"{d.on_rig.gain_margin:.3g}" if isfinite(d.on_rig.gain_margin) else "over 200"


def _delay(d: Demonstration) -> str:
    if d.on_rig is None:
        return "–"
    return cell(1e3 * d.on_rig.delay_margin) if isfinite(d.on_rig.delay_margin) else "over 1000"


def _pictures(found: Lesson) -> Section:
    section, units = Section("To look at", "pictures"), found.drive.units
    try:
        gifs = [
            (
                animated(found.t, found.xr, d.run, f"{d.name}: {d.law}", found.drive.voltage_limit, units),
                _caption(d, units),
            )
            for d in found.shown
        ]
    except ModuleNotFoundError as error:
        section.text(f"Moving pictures are left out: {error}")
        return section
    section.gallery(gifs)
    return section


def _caption(d: Demonstration, units: Units) -> str:
    grows = "" if d.measures.stable else ", growing"
    rms, swing = (units.text(value, "mm", 3) for value in (d.measures.rms, d.vibration))
    return f"{d.name}: error {rms} rms, x2 swings {swing} in the dwells{grows}."


def _responses(found: Lesson) -> Section:
    section = Section("The same, standing still", "responses", units=found.drive.units)
    section.figure(
        plots.plot_lesson(found), "Positions and error along the handout's trajectory; the errors share one scale."
    )
    return section


def _beyond(found: Lesson) -> Section:
    """Say what Lab 4 and a learnt policy add, and where the learnt one stands."""
    section, mm = Section("Beyond P-control", "beyond"), found.drive.units.length
    lab4, collocated = found.find("Lab 4"), found.find("P(x1), collocated")
    stable = [d for d in found.shown if d.name.startswith("P(x2)") and d.measures.stable]
    if lab4 and stable:
        best = min(stable, key=lambda d: d.measures.rms)
        section.text(
            f"Lab 4 reads x2 as well, so it controls what is to be positioned, and its notch keeps the spring from "
            "limiting the gain: "
            f"{lab4.measures.rms:.3g} {mm} rms, against {best.measures.rms:.3g} {mm} of the best P(x2) here that does not grow"
            + (f" and {collocated.measures.rms:.3g} {mm} of P(x1)." if collocated else ".")
        )
    if not found.learnt:
        section.text("No learnt policy took part; 'flexdrive train' makes one, and --agents names it.")
        return section
    rl = found.shown[-1]
    section.text(
        f"The last column learnt by trial on simulated drives ({found.learnt}, the middle of {found.seeds} training seeds). It "
        f"reads {rl.reads} and acts every {1e3 * rl.period:g} ms: {rl.measures.rms:.3g} {mm} rms, "
        f"{rl.parts.offset:.3g} {mm} left in the dwells, {rl.vibration:.3g} {mm} of swing there."
    )
    if lab4:
        ratio = rl.measures.rms / lab4.measures.rms
        section.text(
            f"Against Lab 4 its error is {ratio:.2f} times as large"
            + (": it wins on this trajectory." if ratio < 1.0 else ": Lab 4 wins on this trajectory.")
            + " compare.html says how sure that is, on other drives and references too, and why."
        )
    return section

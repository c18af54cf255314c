"""The page of a diagnosis: what was left out, understood in a minute."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence

from baselines.report import words
from baselines.report.fault_table import add_faults, shaded
from baselines.report.page import Section, render
from flexdrive_gym import Recording, __version__
from identification.mismatch.crew import Crew
from identification.diagnosis.replay import Remaining, remaining, replays
from identification.mismatch.shapes import ALONG_TRACK, FRICTION
from identification.diagnosis.suggest import Suggestion
from identification.mismatch.verdict import Diagnosis, RecordingFit
from identification.recordings.faults import gathered

_MOST_FAULTS = 6
# the page is wider than an A4 report's text
_DPI = 130.0


def build_diagnosis(
    diagnosis: Diagnosis,
    *,
    title: str = "Diagnosis of a flexible drive",
    suggestions: Sequence[Suggestion] = (),
    jobs: int | None = None,
) -> str:
    """Return the page as one self-contained HTML file.

    Parameters
    ----------
    diagnosis
        With its predictions.
    title
        Heading of the page.
    suggestions
        Experiments that would separate what cannot be told apart.
    jobs
        Threads; default: the processors this process may use.
    """
    with Crew(jobs or len(os.sched_getaffinity(0))) as pool:
        forces = remaining(diagnosis, pool)
        sections = [
            _overlay(diagnosis, pool),
            _maps(diagnosis, forces),
            _findings(diagnosis),
            _suggestions(suggestions),
            _faults(diagnosis),
            _remains(diagnosis, forces),
            _recordings(diagnosis),
            _predictions(diagnosis),
            _baseline(diagnosis),
            _harmonics(diagnosis),
        ]
    return render(
        "diagnosis.html.j2",
        title=title,
        subtitle=_subtitle(diagnosis),
        verdict=words.verdict_sentences(diagnosis),
        tiles=_tiles(diagnosis),
        sections=[s for s in sections if s.blocks],
        footer=f"Made by flexdrive {__version__} in {diagnosis.seconds:.0f} s.",
    )


def main_sections(diagnosis: Diagnosis, *, jobs: int | None = None) -> list[Section]:
    """Return what the handout's report shows of a diagnosis: the overlay, the missing force, the findings."""
    with Crew(jobs or len(os.sched_getaffinity(0))) as pool:
        forces = remaining(diagnosis, pool)
        sections = [_overlay(diagnosis, pool), _maps(diagnosis, forces), _findings(diagnosis), _predictions(diagnosis)]
    for section, title in zip(
        sections,
        (
            "Diagnosis: measured against simulated",
            "Diagnosis: the force that is missing",
            "Diagnosis: findings",
            "Diagnosis: what the naming changes",
        ),
        strict=True,
    ):
        section.title, section.anchor = title, f"diagnosis-{section.anchor}"
    return [s for s in sections if s.blocks]


def _subtitle(d: Diagnosis) -> str:
    kept = len(d.split.prove) + len(d.split.loops)
    return f"{len(d.split.learn) + kept} recordings: {len(d.split.learn)} in the estimation set, {kept} held out"


def _tiles(d: Diagnosis) -> list[dict[str, str]]:
    worse = words.worsened(d)
    tiles = [
        {
            "number": f"{_number(d.before_rms)} → {_number(d.after_rms)}" if d.findings else _number(d.before_rms),
            "caption": f"rms error [{d.unit}] {words.where_proven(d)}",
        },
        {
            "number": _number(d.floor_rms),
            "caption": f"floor [{d.unit}]: what differs between repetitions",
        },
    ]
    if d.own_rms is not None and d.findings:
        tiles.append(
            {
                "number": " → ".join(map(_number, d.own_rms)),
                "caption": f"rms error [{d.unit}] on them, each run with its own dry friction",
            }
        )
    if worse:
        first = worse[0]
        more = f", and {len(worse) - 1} more" if len(worse) > 1 else ""
        tiles.append(
            {
                "number": f"{_number(first.before_rms)} → {_number(first.after_rms)}",
                "caption": f"rms error [{first.unit}] of {first.recording}, which got worse{more};",
                "worse": "yes",
            }
        )
    reach = words.within_reach(d)
    # friction that differs between runs can make a better drive miss a run in which a cart rests
    if reach > 0.0 and d.findings:
        tiles.append({"number": f"{reach:.0%}", "caption": "of the squared error above the floor removed"})
    if d.findings:
        worst = max(f.false_alarm_probability for f in d.findings)
        tiles.append({"number": f"≤ {worst:.2g}", "caption": "false-alarm probability of each finding"})
    shown = words.telling_prediction(d)
    if shown is not None and d.findings:
        rig = f"; the rig: {shown.measured}" if shown.measured else ""
        tiles.append(
            {
                "number": f"{_number(shown.before)} → {_number(shown.after)}",
                "caption": f"{shown.name} [{shown.unit}]{rig}",
            }
        )
    return tiles


def _number(value: float | None) -> str:
    return "–" if value is None or not math.isfinite(value) else f"{value:.3g}"


def _improvement(f: RecordingFit) -> float:
    return 1.0 - (f.after_rms / f.before_rms) ** 2 if f.before_rms > 0.0 else -math.inf


def shown_recording(d: Diagnosis) -> tuple[Recording, RecordingFit]:
    """Return the held-out recording whose improvement is the median; one of the estimation set where none is held out."""
    runs = {r.name: r for r in (*d.split.prove, *d.split.loops, *d.split.learn)}
    fits = [f for f in d.per_recording if f.recording in runs and math.isfinite(f.before_rms + f.after_rms)]
    ranked = sorted([f for f in fits if f.held_out] or fits, key=_improvement)
    middle = ranked[(len(ranked) - 1) // 2]
    return runs[middle.recording], middle


def _overlay(d: Diagnosis, pool: Crew) -> Section:
    from identification.plots import plot_before_after, plot_validation  # noqa: PLC0415  (matplotlib)

    section = Section("Measured against simulated", "overlay")
    if not d.per_recording:
        return section
    run, fit = shown_recording(d)
    drive = d.learnt or d.drive
    before, after = (replays(each, [run], pool)[0] for each in (d.free, drive))
    kept = "of the estimation set"
    if fit.held_out:
        kept = "held out" if d.learnt else "held out during the search"
    about = f"{run.name}: {run.excitation}, {kept}"
    if not d.findings:
        section.figure(
            plot_validation(run, before), f"{about}. No effect was named: this is the best fit without any.", dpi=_DPI
        )
        return section
    section.figure(
        plot_before_after(run, before, after),
        f"{about}. Of such recordings half improved more and half less. Left: the best fit without left-out "
        f"physics. Right: with the named physics.{shaded(run)}",
        dpi=_DPI,
    )
    return section


def _maps(d: Diagnosis, forces: Remaining) -> Section:
    from identification.plots import plot_curve, plot_maps, plot_telling_map  # noqa: PLC0415

    section = Section("The force that is missing", "maps")
    if not forces.before:
        return section
    if len(d.located) > 1:
        parts = [f"{p.share_of_error:.0%} of it on {p.where.replace('_', ' ')}" for p in d.located]
        section.text(f"By mean square, {words.listed(parts)}.")
    if d.unnamed is not None and d.unnamed.curve is not None:
        curve, cart = d.unnamed.curve, d.unnamed.where.replace("_", " ")
        about = (
            f"What has no name: the force missing on {cart} as a free function of {curve.variable.removeprefix(FRICTION)}, "
            "with two standard errors over the recordings."
        )
        if curve.variable == ALONG_TRACK:
            about += " Every run began anywhere; they were laid over one another until they agreed."
        section.figure(plot_curve(curve, d.unnamed.where), about, dpi=_DPI)
    small = (
        "The same for both carts against everything a force could depend on, with the share of the missing force that each "
        "map predicts in recordings left out"
    )
    point = "Every point is an instant of a recording: the force that the drive's equations lack, against what it follows most."
    if not d.findings:
        section.text(f"{forces.before[0].sentence[0].upper()}{forces.before[0].sentence[1:]}.")
        section.figure(plot_telling_map(forces.measured, forces.before[0]), point, dpi=_DPI)
        section.figure(plot_maps(forces.before), f"{small}.", dpi=_DPI)
        return section
    i = forces.most_telling()
    section.text(f"Before, {forces.before[i].sentence}. With the named physics, {forces.after[i].sentence}.")
    section.figure(
        plot_telling_map(forces.measured, forces.before[i], forces.left, forces.supply[i], forces.after[i]),
        f"{point} Dashed: what the named physics supplies in the diagnosed drive's own runs.",
        dpi=_DPI,
    )
    section.figure(plot_maps(forces.before, forces.after), f"{small}, before (brown) and after (blue).", dpi=_DPI)
    return section


def _findings(d: Diagnosis) -> Section:
    section = Section("Findings", "findings")
    if not d.findings:
        section.text("None: no effect of the catalogue is significant.")
        return section
    section.items([f.statement for f in d.findings])
    tied = any(f.ties for f in d.findings)
    rows = [
        (
            f"{words.at(f.id, f.where)}\n{words.equation(f.id)}",
            "\n".join(f"{n} = {e}" for n, e in f.parameters.items()),
            f"{f.share_of_error_explained:.0%}",
            f"{f.false_alarm_probability:.2g}",
            f"{_number(f.heldout_rms_before)} → {_number(f.heldout_rms_after)}",
            *(
                ("\n".join(words.at(t.id, t.where) for t in f.ties) or "nothing", f.separating_experiment or "–")
                if tied
                else ()
            ),
        )
        for f in d.findings
    ]
    section.table(
        (
            "finding and its law",
            "parameters [95 % interval]",
            "explains",
            "false alarm",
            f"held out, before → after [{d.findings[0].unit}]",
            *(("cannot be told from", "to tell them apart, record") if tied else ()),
        ),
        rows,
    )
    section.text(
        "“Explains”: the drive is refitted without the finding; this share of the squared error that is then left goes when the "
        "finding is put back. “False alarm”: the probability that the best candidate of the whole catalogue scores as high on a "
        "rig with none of these effects, only friction that differs between runs, an uneven track and noise."
    )
    return section


def _suggestions(suggestions: Sequence[Suggestion]) -> Section:
    section = Section("Experiments that would tell more", "suggestions")
    if suggestions:
        section.text("Expected rms difference between the velocities of two explanations, in multiples of the floor.")
        names = list(suggestions[0].separation)
        section.table(
            ("input file", *names), [(s.file, *(_number(s.separation[n]) for n in names)) for s in suggestions]
        )
    return section


def _faults(d: Diagnosis) -> Section:
    section = Section("Sensor faults", "faults")
    faults = [f for f in d.faults if f.id != "saturation"]
    if not faults:
        section.text("None found.")
        return section
    section.folded = len(faults) > _MOST_FAULTS
    recordings = len({f.recording for f in faults})
    section.title = f"Sensor faults: {len(faults)} in {recordings} recording{'s' if recordings > 1 else ''}"
    section.text("Data faults, not physics: left out of everything on this page.")
    add_faults(section, gathered(faults))
    return section


def _remains(d: Diagnosis, forces: Remaining) -> Section:
    section = Section("What remains", "remains")
    lines = []
    if d.unnamed is not None:
        nearest = ", ".join(f"{words.effect_name(n)} ({s:.0%} alike)" for n, s in d.unnamed.nearest)
        lines.append(
            f"Unnamed: {d.unnamed.share_of_error:.0%} of the error left is a force on {d.unnamed.where.replace('_', ' ')} that "
            f"follows {d.unnamed.acts_on}. Nearest names: {nearest or 'none'}."
        )
    after = sorted((m for m in forces.after if m.explained >= 0.02), key=lambda m: -m.explained * m.size**2)
    lines += [f"{m.sentence[0].upper()}{m.sentence[1:]}." for m in after[:2]]
    if not after:
        lines.append("What remains follows none of v1, v2, δ, u, x1, x2 and time.")
    lines += [f"{note[0].upper()}{note[1:]}." for note in d.notes if note]
    section.items(lines)
    return section


def _recordings(d: Diagnosis) -> Section:
    section = Section("Every recording", "recordings", folded=True)
    rows = [
        (
            f.recording,
            "held out" if f.held_out else "",
            _number(f.before_rms),
            _number(f.after_rms),
            _number(f.floor_rms),
            f.unit,
        )
        for f in sorted(d.per_recording, key=lambda f: (not f.held_out, f.unit, words.by_number(f.recording)))
    ]
    section.table(("recording", "", "before", "after", "floor", "unit"), rows)
    section.text("Rms error; open-loop runs are replayed, P-control runs are simulated in the loop.")
    return section


def _predictions(d: Diagnosis) -> Section:
    section = Section("What the naming changes" if d.findings else "What the drive predicts", "predictions")
    if d.predictions and not d.findings:
        section.table(
            ("prediction", "free fit", "unit", "on the rig"),
            [(p.name, _number(p.before), p.unit, p.measured or "–") for p in d.predictions],
        )
    elif d.predictions:
        changes = [(p.name, _number(p.before), _number(p.after), p.unit, p.measured or "–") for p in d.predictions]
        section.table(("prediction", "before", "after", "unit", "on the rig"), changes)
    return section


def _baseline(d: Diagnosis) -> Section:
    section = Section("The handout's ratios", "baseline")
    for line in words.ratio_sentences(d):
        section.text(line)
    return section


def _harmonics(d: Diagnosis) -> Section:
    section = Section("Harmonics of the missing force", "harmonics", folded=True)
    if not d.harmonics:
        return section
    section.text(
        "Even harmonics come from what treats forward and backward differently; a law that is odd in u makes none."
    )
    rows = [
        (
            h.recording,
            h.where.replace("_", " "),
            f"{h.frequency:.3g}",
            *(f"{1e3 * a:.1f}" for a in h.amplitude),
            f"{h.even:.0%}",
        )
        for h in sorted(d.harmonics, key=lambda h: (h.where, h.frequency, words.by_number(h.recording)))
    ]
    section.table(
        ("recording", "missing on", "f [Hz]", "1st [mV]", "2nd", "3rd", "4th", "5th", "even share of power"), rows
    )
    return section

"""The page of a diagnosis: what was left out, understood in a minute."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import replace

from baselines.lab.prediction_names import prediction_name
from baselines.report import words
from baselines.report.fault_table import add_faults, shaded
from baselines.report.page import Section, render
from flexdrive_gym import Drive, Recording, __version__
from identification.mismatch.remaining import Remaining, remaining, replay
from identification.mismatch.suggest import Suggestion
from identification.mismatch.verdict import Diagnosis, RecordingFit
from identification.recordings.faults import gathered
from identification.reversals import Reversal, mean_reversal

_MOST_FAULTS = 6
# amplitudes whose reversals are drawn
_MOST_AMPLITUDES = 2
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
    with ThreadPoolExecutor(jobs or len(os.sched_getaffinity(0))) as pool:
        forces = remaining(diagnosis, pool)
        sections = [
            _findings(diagnosis),
            _overlay(diagnosis),
            _reversals(diagnosis, pool),
            _recordings(diagnosis),
            _predictions(diagnosis),
            _homogeneity(diagnosis),
            _remains(diagnosis, forces),
            _suggestions(suggestions),
            _maps(diagnosis, forces),
            _faults(diagnosis),
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
    """Return what the handout's report shows of a diagnosis: findings, the overlay, the missing force, predictions."""
    with ThreadPoolExecutor(jobs or len(os.sched_getaffinity(0))) as pool:
        forces = remaining(diagnosis, pool)
        sections = {
            "findings": _findings(diagnosis),
            "measured against simulated": _overlay(diagnosis),
            "the force that is missing": _maps(diagnosis, forces),
            "what the naming changes": _predictions(diagnosis),
        }
    for title, section in sections.items():
        section.title, section.anchor = f"Diagnosis: {title}", f"diagnosis-{section.anchor}"
    return [s for s in sections.values() if s.blocks]


def _subtitle(d: Diagnosis) -> str:
    kept = len(d.split.report) + len(d.split.loops)
    fitted = len(d.split.estimation)
    return f"{fitted + kept} recordings: {fitted} estimate and, each predicted by the others, select; {kept} kept for the report"


def _tiles(d: Diagnosis) -> list[dict[str, str]]:
    worse = words.worsened(d)
    tiles = [
        {
            "number": f"{_number(d.before_rms)} → {_number(d.after_rms)}" if d.findings else _number(d.before_rms),
            "caption": f"rms error [{d.unit}] {words.where_reported(d)}",
        },
        {
            "number": _number(d.floor_rms),
            "caption": f"floor [{d.unit}]: what differs between repetitions",
        },
    ]
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
        worst = max(f.p_value for f in d.findings)
        tiles.append({"number": f"≤ {worst:.2g}", "caption": "p-value of each finding"})
    shown = words.telling_prediction(d)
    if shown is not None and d.findings:
        rig = f"; the rig: {shown.measured}" if shown.measured else ""
        beyond = "; extrapolated" if shown.extrapolated else ""
        name = prediction_name(shown.name, d.drive.units)
        tiles.append(
            {
                "number": f"{_number(shown.before.value)} → {_number(shown.after.value)}",
                "caption": f"{name} [{shown.unit}]{rig}{beyond}",
            }
        )
    return tiles


def _number(value: float | None) -> str:
    return "–" if value is None or not math.isfinite(value) else f"{value:.3g}"


def _findings(d: Diagnosis) -> Section:
    section = Section("Findings", "findings")
    if not d.findings:
        section.text("None: no effect of the catalogue is significant.")
        return section
    tied = any(f.ties for f in d.findings)
    rows = [
        (
            f"{words.at(f.id, f.where)}\n{words.equation(f.id)}",
            "\n".join(f"{n} = {e}" for n, e in f.parameters.items()),
            f"{f.share_of_error_explained:.0%}",
            f"{f.p_value:.2g}",
            f"{_number(f.report_rms_before)} → {_number(f.report_rms_after)}",
            *(
                ("\n".join(words.at(t.id, t.where) for t in f.ties) or "nothing", f.separating_experiment or "–")
                if tied
                else ()
            ),
        )
        for f in d.findings
    ]
    kept = "report recordings" if d.split.report else "these recordings"
    section.table(
        (
            "finding and its law",
            "parameters [95 % interval]",
            "explains",
            "p-value",
            f"{kept}, before → after [{d.unit}]",
            *(("cannot be told from", "to tell them apart, record") if tied else ()),
        ),
        rows,
    )
    section.text(
        "In the order in which they were accepted. “Explains”: the share that goes of the squared error left by what was "
        "accepted before, every recording weighted by its own noise. "
        "The p-value: how often the best candidate of the whole catalogue "
        "predicts other recordings as well in data of this rig in which nothing is left out."
    )
    return section


def _improvement(f: RecordingFit) -> float:
    return 1.0 - (f.after_rms / f.before_rms) ** 2 if f.before_rms > 0.0 else -math.inf


def shown_recording(d: Diagnosis) -> tuple[Recording, RecordingFit]:
    """Return the report recording whose improvement is the median; one of the estimation set where there is none."""
    runs = {r.name: r for r in (*d.split.report, *d.split.loops, *d.split.estimation)}
    fits = [
        f
        for f in d.per_recording
        if f.recording in runs and math.isfinite(f.before_rms + f.after_rms) and not f.how.startswith("windows")
    ]
    ranked = sorted([f for f in fits if f.part == "report"] or fits, key=_improvement)
    middle = ranked[(len(ranked) - 1) // 2]
    return runs[middle.recording], middle


def _overlay(d: Diagnosis) -> Section:
    from identification.plots import plot_before_after, plot_validation  # noqa: PLC0415  (matplotlib)

    section = Section("Measured against simulated", "overlay")
    if not d.per_recording:
        return section
    run, fit = shown_recording(d)
    before, after = (replay(each, run) for each in (d.base, d.drive))
    about = (
        f"{run.name}: {run.excitation.text(run.units)}, {'kept for the report' if fit.part == 'report' else 'fitted'}"
    )
    if not d.findings:
        section.figure(plot_validation(run, before), f"{about}. No effect was named: this is the base model.", dpi=_DPI)
        return section
    section.figure(
        plot_before_after(run, before, after),
        f"{about}. Of such recordings half improved more and half less. Left: the base model. Right: with the named "
        f"physics.{shaded(run)}",
        dpi=_DPI,
    )
    return section


def _reversals(d: Diagnosis, pool: Executor) -> Section:
    """Show the mean of all reversals of the command, per amplitude of square wave."""
    from identification.plots.reversals import plot_reversals  # noqa: PLC0415

    section = Section("Reversals of the command, aligned", "reversals")
    groups: dict[str, list[tuple[Recording, Reversal]]] = {}
    for r in (*d.split.estimation, *d.split.report):
        found = None if r.closed_loop else mean_reversal(r)
        if found is not None:
            groups.setdefault(f"{r.excitation.text(r.units)}", []).append((r, found))
    if not groups:
        return section
    chosen = dict(sorted(groups.items(), key=lambda item: -sum(f.count for _, f in item[1]))[:_MOST_AMPLITUDES])
    units = d.base.units
    speed = units.one("mm/s")
    models = {"base model": d.base} if not d.findings else {"before": d.base, "after": d.drive}
    simulated = {name: _simulated_reversals(drive, chosen, pool, speed) for name, drive in models.items()}
    measured = {title: [_scaled(found, speed) for _, found in rows] for title, rows in chosen.items()}
    counts = sum(found.count for rows in chosen.values() for _, found in rows)
    section.figure(
        plot_reversals(measured, simulated, unit=units.name("mm/s")),
        f"Mean over all reversals of the command ({counts}), one thick line for each recording, turned so that the command "
        "rises. What differs between runs averages out; repetitions fall onto one line, and where simulation leaves it, "
        "physics is missing. A jump in both velocities within 10 ms is faster than the spring can carry: a base that recoils, "
        "play, or delay.",
        dpi=_DPI,
    )
    return section


def _simulated_reversals(
    drive: Drive, groups: Mapping[str, Sequence[tuple[Recording, Reversal]]], pool: Executor, speed: float
) -> dict[str, list[Reversal]]:
    """Return the mean reversals of a drive in the first recording of every group."""

    def one(recording: Recording) -> list[Reversal]:
        run = replay(drive, recording)
        found = mean_reversal(recording, [v for v in (run.v1, run.v2) if v is not None])
        return [] if found is None else [_scaled(found, speed)]

    first = [rows[0][0] for rows in groups.values()]
    return dict(zip(groups, pool.map(one, first), strict=True))


def _scaled(reversal: Reversal, speed: float) -> Reversal:
    return replace(reversal, v=reversal.v / speed)


def _recordings(d: Diagnosis) -> Section:
    section = Section("Recordings, before and after", "recordings")
    places = any(f.after_position_rms is not None for f in d.per_recording)
    length = d.base.units.length
    columns = (
        "recording",
        "before",
        "after",
        "floor",
        "unit",
        *((f"position before → after [{length}]",) if places else ()),
    )
    parts = {"report": "Kept for the report: opened when the names were final", "estimation": "Fitted"}
    for part, heading in parts.items():
        fits = [f for f in d.per_recording if f.part == part]
        rows = [
            (
                f.recording + ("" if f.how == "replay" else f" ({f.how})"),
                _number(f.before_rms),
                _number(f.after_rms),
                _number(f.floor_rms),
                f.unit,
                *((f"{_number(f.before_position_rms)} → {_number(f.after_position_rms)}",) if places else ()),
            )
            for f in sorted(fits, key=lambda f: (f.unit, words.by_number(f.recording)))
        ]
        if rows:
            folded = part == "estimation" and len(d.per_recording) > len(fits)
            if not folded:
                section.heading(heading)
            section.table(columns, rows, folded=f"{heading}: {len(rows)} recordings" if folded else "")
    section.text("Rms error; open-loop runs are replayed, P-control runs are simulated in the loop.")
    return section


def _predictions(d: Diagnosis) -> Section:
    section = Section("What the naming changes" if d.findings else "What the drive predicts", "predictions")
    if not d.predictions:
        return section
    section.table(
        (
            "prediction",
            *(("before [95 %]", "after [95 %]") if d.findings else ("[95 %]",)),
            "unit",
            "on the rig",
            "extrapolated",
        ),
        [
            (
                prediction_name(p.name, d.drive.units),
                *([words.interval(p.before)] if d.findings else []),
                words.interval(p.after),
                p.unit,
                p.measured or "–",
                "yes" if p.extrapolated else "no",
            )
            for p in d.predictions
        ],
    )
    section.text(
        "Of another run of this rig: simulated on draws of the drive, parameters from the jackknife over recordings and dry "
        "friction as it differs from run to run."
    )
    section.items(words.extrapolation_sentences(d))
    return section


def _homogeneity(d: Diagnosis) -> Section:
    section = Section("Is the rig the same in all sessions?", "homogeneity")
    section.text(words.homogeneity_sentence(d))
    if d.homogeneity:
        names = list(dict.fromkeys(s for h in d.homogeneity for s in h.values))
        section.table(
            ("parameter", "p-value", *names),
            [
                (h.parameter, f"{h.p_value:.2g}", *(_number(h.values.get(s)) for s in names))
                for h in sorted(d.homogeneity, key=lambda h: h.p_value)
            ],
        )
    return section


def _remains(d: Diagnosis, forces: Remaining) -> Section:
    section = Section("What could not be told", "remains")
    lines = [line for f in d.findings for line in words.tie_sentences(f)]
    if d.unnamed is not None:
        nearest = ", ".join(f"{words.effect_name(n)} (gains {s:.0%} of it)" for n, s in d.unnamed.nearest)
        lines.append(
            f"Unnamed: {d.unnamed.share_of_error:.0%} of the squared error left is a force on "
            f"{d.unnamed.where.replace('_', ' ')} {d.unnamed.acts_on}. Nearest names: {nearest or 'none'}."
        )
    after = sorted((m for m in forces.after if m.explained >= 0.02), key=lambda m: -m.explained * m.size**2)
    lines += [f"{m.sentence[0].upper()}{m.sentence[1:]}." for m in after[:2]]
    if not after:
        lines.append("What remains follows none of v1, v2, δ, u, x1, x2 and time.")
    lines += [f"{note[0].upper()}{note[1:]}." for note in d.notes if note]
    section.items(lines)
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


def _maps(d: Diagnosis, forces: Remaining) -> Section:
    from identification.plots import plot_curve, plot_maps, plot_telling_map  # noqa: PLC0415

    section = Section("The force that is missing", "maps")
    if not forces.before:
        return section
    if len(d.located) > 1:
        parts = [f"{p.share_of_error:.0%} of it on {p.where.replace('_', ' ')}" for p in d.located]
        section.text(f"By mean square, {words.listed(parts)}.")
    if d.unnamed is not None and d.unnamed.curve is not None:
        section.figure(
            plot_curve(d.unnamed.curve, d.unnamed.where),
            f"What has no name: the force as a free function of {d.unnamed.curve.variable}, with two standard errors over the "
            "recordings.",
            dpi=_DPI,
        )
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
            *(f"{a:.2g}" for a in h.amplitude),
            f"{h.even:.0%}",
        )
        for h in sorted(d.harmonics, key=lambda h: (h.where, h.frequency, words.by_number(h.recording)))
    ]
    unit = d.harmonics[0].unit
    section.table(
        ("recording", "missing on", "f [Hz]", f"1st [{unit}]", "2nd", "3rd", "4th", "5th", "even share of power"), rows
    )
    return section

"""The page of a diagnosis: what was left out, understood in a minute."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

from baselines.lab.prediction_names import prediction_name
from baselines.report import diagnosis_pictures as pictures
from baselines.report import words
from baselines.report.fault_table import add_faults
from baselines.report.page import Section, render
from flexdrive_gym import __version__
from identification.mismatch.answer.finding import percent
from identification.mismatch.answer.remaining import Remaining, remaining
from identification.mismatch.answer.suggest import Suggestion
from identification.mismatch.answer.verdict import Diagnosis
from identification.recordings.faults import gathered

_MOST_FAULTS = 6

# what acts along the track, which runs begin anywhere on
_ALONG = {"position_friction": "bumps of friction", "ground_spring": "springs to ground"}


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
        Experiments that would separate tied explanations.
    jobs
        Threads; default: the processors this process may use.
    """
    with ThreadPoolExecutor(jobs or len(os.sched_getaffinity(0))) as pool:
        forces = remaining(diagnosis, pool)
        sections = [
            _findings(diagnosis),
            pictures.overlay(diagnosis),
            pictures.reversals(diagnosis, pool),
            _recordings(diagnosis),
            _predictions(diagnosis),
            _homogeneity(diagnosis),
            _remains(diagnosis, forces),
            _limits(diagnosis),
            _suggestions(suggestions),
            pictures.maps(diagnosis, forces),
            _faults(diagnosis),
            _baseline(diagnosis),
            pictures.harmonics(diagnosis),
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
            "measured against simulated": pictures.overlay(diagnosis),
            "the force that is missing": pictures.maps(diagnosis, forces),
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
        nothing = "no effect of the catalogue is significant"
        section.text(f"None: {nothing if d.unnamed is None else 'what is significant has no name in the catalogue'}.")
        return section
    tied = any(f.ties for f in d.findings)
    rows = [
        (
            f"{words.at(f.id, f.where)}\n{words.equation(f.id)}",
            "\n".join(f"{n} = {e}" for n, e in f.parameters.items()),
            percent(f.share_of_error_explained),
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
            *(("tied with", "to separate them, record") if tied else ()),
        ),
        rows,
    )
    section.text(
        "In the order in which they were accepted. “Explains”: the share that goes of the squared error left by what was "
        "accepted before, every recording weighted by its own noise. "
        "The p-value: how often, at most, the best candidate of the whole catalogue "
        "predicts other recordings as well in data of this rig in which nothing is left out."
    )
    return section


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
        "Of another run of this rig: simulated on draws of the drive, parameters by their joint uncertainty and dry "
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
    section = Section("What could not be decided", "remains")
    lines = [line for f in d.findings for line in words.tie_sentences(f)]
    if d.unnamed is not None:
        nearest = ", ".join(f"{words.at(n.id, n.where)} (gains {s:.0%} of it)" for n, s in d.unnamed.nearest)
        lines.append(
            f"Unnamed: {percent(d.unnamed.share_of_error)} of the squared error left is {words.without_name(d.unnamed)}. "
            f"Nearest names: {nearest or 'none'}."
        )
    after = sorted((m for m in forces.after if m.explained >= 0.02), key=lambda m: -m.explained * m.size**2)
    lines += [f"{m.sentence[0].upper()}{m.sentence[1:]}." for m in after[:2]]
    if not after:
        lines.append("What remains follows none of v1, v2, δ, u, x1, x2 and time.")
    lines += [f"{note[0].upper()}{note[1:]}." for note in d.notes if note]
    section.items(lines)
    return section


def _limits(d: Diagnosis) -> Section:
    section = Section("How small it may be and not be seen", "limits")
    if d.detection_limits:
        section.text(
            "What is not named is not absent. Below this size an effect would not gain enough in most data sets like these: to "
            "first order, in its most visible form, and beside what was named; what friction makes of it may hide more. What "
            "differs from run to run hides what is like it."
        )
        along = [what for id_, what in _ALONG.items() if any(x.id == id_ for x in d.detection_limits)]
        if along:
            section.text(
                f"Where along the track runs began is not known, so {words.listed(along)} are hidden most: these recordings "
                "cannot tell them from a rough track unless they are much larger. Runs that begin at one marked place would."
            )
        section.table(
            ("effect", "size", "not seen below", "unit", "over what is usual", "in the form"),
            [
                (
                    words.at(x.id, x.where),
                    x.parameter,
                    _number(x.value) if math.isfinite(x.value) else "any within its bounds",
                    x.unit,
                    f"{x.value / x.usual:.2g}" if math.isfinite(x.value) and x.usual > 0.0 else "–",
                    ", ".join(f"{n} = {_number(v)} {'' if u == '1' else u}".rstrip() for n, (v, u) in x.shape.items())
                    or "–",
                )
                for x in sorted(d.detection_limits, key=lambda x: -x.value / x.usual if x.usual > 0.0 else 0.0)
            ],
            folded=f"{len(d.detection_limits)} sizes, the hardest to see first",
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


def _baseline(d: Diagnosis) -> Section:
    section = Section("The handout's ratios", "baseline")
    for line in words.ratio_sentences(d):
        section.text(line)
    return section

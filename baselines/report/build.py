"""The handout's whole report (3.5) from a folder of recordings."""

from __future__ import annotations

import math
from collections.abc import Sequence

from baselines.loop_analysis.stability_limit import explain
from baselines.report import sections as parts
from baselines.report.diagnosis import main_sections
from baselines.report.findings import STEPS, Findings, Progress, find
from baselines.report.page import render
from baselines.report.words import verdict_sentences
from flexdrive_gym import Recording, __version__
from identification.likelihood import improvement
from identification.mismatch.answer.verdict import Diagnosis
from identification.quantities import HANDOUT_RATIOS

__all__ = ["STEPS", "build_report"]


def build_report(
    recordings: Sequence[Recording],
    *,
    title: str,
    diagnosis: Diagnosis | None = None,
    progress: Progress = lambda _: None,
) -> str:
    """Return the report as one self-contained HTML page.

    Parameters
    ----------
    recordings
        A data set.
    title
        Heading of the page.
    diagnosis
        Of the same recordings, shown first.
    progress
        Told the name of every step before it begins.
    """
    found = find(recordings, progress)
    progress("figures")
    sections = [
        *([] if diagnosis is None else main_sections(diagnosis)),
        parts.values(found),
        parts.p_control_section(found),
        parts.step_responses(found),
        parts.sines(found),
        parts.identification(found),
        parts.time_domain(found),
        parts.frequency_domain(found),
        parts.stability(found),
        parts.faults(found),
    ]
    progress("page")
    return render(
        title=title,
        subtitle=_subtitle(found),
        summary=[*([] if diagnosis is None else verdict_sentences(diagnosis)), *_summary(found)],
        sections=sections,
        footer=f"Made by flexdrive {__version__}.",
    )


def _subtitle(found: Findings) -> str:
    kinds = {"square": 0, "sine": 0, "closed_loop": 0, "other": 0}
    for r in found.recordings:
        kinds[r.excitation.kind] += 1
    seconds = sum(r.n * r.sample_time for r in found.recordings)
    names = {"square": "squares", "sine": "sines", "closed_loop": "P-control runs", "other": "others"}
    parts = ", ".join(f"{n} {names[k]}" for k, n in kinds.items() if n)
    simulated = any(r.source == "simulated" for r in found.recordings)
    return f"{len(found.recordings)} recordings: {parts}; {seconds:.0f} s in all" + (
        " (simulated)" if simulated else ""
    )


def _summary(found: Findings) -> list[str]:
    fit, units = found.fit, found.likely.drive.units
    floor = (
        "The floor, what differs between repetitions and so cannot be explained by a model, is "
        f"{units.text(found.validation.floor, 'mm/s', 3)}."
        if math.isfinite(found.validation.floor)
        else "No run repeats itself, so there is no floor to compare it with."
    )
    rms = found.validation.rms if math.isfinite(found.validation.rms) else fit.rms
    lines = [
        f"Identified by maximum likelihood: the rms error of the velocities is {units.text(rms, 'mm/s', 3)}. {floor}"
    ]
    if found.tied is not None:
        ratios = ", ".join(f"{n} = {fit.ratios[n].value:.2f} (handout {HANDOUT_RATIOS[n]:g})" for n in HANDOUT_RATIOS)
        lines.append(
            f"With the handout's ratios held, the error is {units.text(found.tied.rms, 'mm/s', 3)}; estimating them "
            "reduces the squared error "
            f"by {improvement(found.tied, fit):.0%}: {ratios}."
        )
    if "x2" in found.limits:
        lines.append(explain(found.task, found.limits["x2"]) + parts.measured_limit(found.observed, found.task.units))
    faults = [f for r in found.recordings for f in r.faults if f.id != "saturation"]
    lines.append(
        f"{len(faults)} data faults were found and masked; they are listed at the end."
        if faults
        else "No data fault was found."
    )
    return lines

"""Pictures of a diagnosis: measured against simulated, reversals aligned, and the force that is missing."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace

from baselines.report import words
from baselines.report.fault_table import shaded
from baselines.report.page import Section
from flexdrive_gym import Drive, Recording
from identification.mismatch.answer.remaining import Remaining, replay
from identification.mismatch.answer.verdict import Diagnosis, RecordingFit
from identification.reversals import Reversal, mean_reversal

# amplitudes whose reversals are drawn
_MOST_AMPLITUDES = 2
# the page is wider than an A4 report's text
_DPI = 130.0


def _improvement(f: RecordingFit) -> float:
    return 1.0 - (f.after_rms / f.before_rms) ** 2 if f.before_rms > 0.0 else -math.inf


def shown_recording(d: Diagnosis) -> tuple[Recording, RecordingFit]:
    """Return the report recording whose improvement is the median; one of the estimation set where there is none.

    Where nothing was named, all improve alike, and velocities stand in the order of their errors.
    """
    runs = {r.name: r for r in (*d.split.report, *d.split.loops, *d.split.estimation)}
    fits = [
        f
        for f in d.per_recording
        if f.recording in runs and math.isfinite(f.before_rms + f.after_rms) and not f.how.startswith("windows")
    ]
    shown = [f for f in fits if f.part == "report"] or fits
    ranked = sorted(shown, key=lambda f: (_improvement(f), f.velocities, f.after_rms))
    middle = ranked[(len(ranked) - 1) // 2]
    return runs[middle.recording], middle


def overlay(d: Diagnosis) -> Section:
    """Show one recording as it was measured and as both drives simulate it."""
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


def reversals(d: Diagnosis, pool: Executor) -> Section:
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


def maps(d: Diagnosis, forces: Remaining) -> Section:
    """Show the missing force of every cart against what it could follow, before and after."""
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


def harmonics(d: Diagnosis) -> Section:
    """List the harmonics of the missing force in recordings of one frequency."""
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

"""Sentences that a reader of a diagnosis should see beside its figures."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexdrive_gym import Drive
from flexdrive_gym.units import Units
from identification.mismatch.answer.errors import rms
from identification.mismatch.answer.finding import Named
from identification.mismatch.answer.verdict import RecordingFit
from identification.mismatch.selection.selector import Selection
from identification.mismatch.split import Split
from identification.replay.output_error import Run, simulate_run

# times as far as recordings went, a spring is looked at
_FARTHER = 10.0
# a logarithm's standard deviation under which friction is the same in all runs, and a share of an error that is no difference
_SAME = 0.01


def notes_of(
    drive: Drive,
    split: Split,
    loops: Sequence[RecordingFit],
    runs: Sequence[Run],
    units: Units,
    selection: Selection,
) -> tuple[str, ...]:
    """Return what a diagnosis rests on and what it cannot say."""
    notes = []
    if split.blocks:
        notes.append("all blocks are parts of one recording: nothing is known of what differs from run to run")
    if not split.report and not split.loops:
        notes.append(
            "too few recordings to keep any for the report: errors are those of the recordings that were fitted"
        )
    windows = [f for f in loops if f.how.startswith("windows")]
    if windows:
        notes.append(
            f"{_listed([f.recording for f in windows])}: the controller is unknown, so they are compared over "
            f"{windows[0].how}, each begun in the measured state"
        )
    if (doubtful := selection.doubtful) is not None:
        notes.append(
            f"{Named(*doubtful.name)} gains {doubtful.total:.2g} units of log-likelihood (p = {doubtful.p:.2g}), where p = "
            f"{selection.level:.2g} is asked for: it is not named"
        )
    if not selection.ended:
        most = len(selection.rounds)
        notes.append(
            f"the search ended after {most} round{'s' if most > 1 else ''}, the most that it may have: more may be left out"
        )
    if selection.hiding is not None:
        notes.append(
            f"unknown forces on {selection.hiding} are more than half of what they may be: something without a name is left out, "
            "and they may hide more, so it is not said how small an effect would not be seen"
        )
    notes.extend(_loop_note(loops, unit, units) for unit in ("mm", "mm/s") if any(f.unit == unit for f in loops))
    spread = drive.run_to_run
    if spread is not None:
        each = {n: float(s) for n, s in zip(spread.names, np.sqrt(np.diag(spread.matrix)), strict=True)}
        told = [f"{n} by {s:.0%}" for n, s in each.items() if s > _SAME]
        if told:
            notes.append(f"dry friction differs from run to run: {' and '.join(told)} (one standard deviation)")
    return (*notes, *_spring_notes(drive, runs, units))


def _loop_note(loops: Sequence[RecordingFit], unit: str, units: Units) -> str:
    """Say whether closed loops, which nothing was estimated from, bear the findings out."""
    own = [f for f in loops if f.unit == unit]
    before, after = (rms([getattr(f, at) for f in own]) for at in ("before_rms", "after_rms"))
    old, new = (units.text(x, unit, 3) for x in (before, after))
    one = len(own) == 1
    counted = f"{'1 closed loop' if one else f'{len(own)} closed loops'}, which nothing was estimated from,"
    if not abs(after - before) > _SAME * before:
        return f"{counted} {'is' if one else 'are'} off by {new}, with or without what was found"
    bears, speaks = ("bears", "speaks") if one else ("bear", "speak")
    verdict = f"{bears} the findings out" if after < before else f"{speaks} against the findings"
    return f"{counted} {verdict}: off by {old} before and {new} after"


def _spring_notes(drive: Drive, runs: Sequence[Run], units: Units) -> tuple[str, ...]:
    """Say beyond which deflection a spring's force falls again, as a power of it does somewhere, and how far recordings went."""
    reached = 0.0
    for run in runs:
        moved = simulate_run(drive.values, run)
        between = moved[0] - moved[1] if len(moved) == 2 else moved[0]
        deflection = between if run.positions else np.cumsum(between) * run.sample_time
        reached = max(reached, float(np.max(np.abs(deflection))))
    tried = np.linspace(0.0, _FARTHER * reached, 1001)
    falls = np.diff(drive.spring_force(tried)) < 0.0, np.diff(-drive.spring_force(-tried)) < 0.0
    turns = [float(tried[np.argmax(side)]) for side in falls if side.any()]
    if not turns:
        return ()
    turn, far = (units.text(x, "mm", 2) for x in (min(turns), reached))
    note = (
        f"the spring's force as it was fitted falls again beyond {turn} of deflection, and runs go to {far}: trust no "
        "simulation that goes much farther than they do"
    )
    return (note,)


def _listed(names: Sequence[str], most: int = 3) -> str:
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")

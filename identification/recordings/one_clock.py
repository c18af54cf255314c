"""The signals of one file on one clock.

A column pairs with the clock that it was logged with, else with the clock of its length. The clock of the command is taken, and
signals of other clocks are interpolated onto it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from identification.recordings.candidates import ROLE, Candidate, File, Roles, either
from identification.recordings.columns import MEASURED, read_label

if TYPE_CHECKING:
    from flexdrive_gym.recording import FloatArray
    from identification.recordings.errors import RecordingError


# of a sampling period by which two clocks of the same instants may differ
_APART = 0.5


@dataclass(frozen=True)
class Clock:
    """A time base and what shows that signals belong to it."""

    t: FloatArray
    group: str = ""
    words: frozenset[str] = frozenset()
    unit: str = ""
    label: str = ""
    own: bool = False  # it stands in the file as a column, not within a signal


def _same(first: FloatArray, second: FloatArray) -> bool:
    return first is second or (
        first.shape == second.shape and bool(np.allclose(first, second, rtol=1e-7, atol=1e-9, equal_nan=True))
    )


def _alike(first: Clock, second: Clock) -> bool:
    """Whether two clocks tell the same instants, wherever they begin: seconds since 1970 beside seconds of the run."""
    alike = (first.t.shape, first.group, first.words) == (second.t.shape, second.group, second.words)
    if not alike or first.t.size < 2:
        return False
    a, b = first.t - first.t[0], second.t - second.t[0]
    return bool(np.all(np.abs(a - b) < _APART * abs(a[-1]) / (a.size - 1)))


def _clocks(file: File) -> list[Clock]:
    """Return the distinct clocks of a file, those of its columns first; of those that tell the same the finest one."""
    found = _all_clocks(file)
    if not file.table.in_lines:
        return found
    ranked = sorted(found, key=lambda clock: float(np.ptp(np.diff(clock.t))) if clock.t.size > 1 else 0.0)
    kept = [c for i, c in enumerate(ranked) if not (c.own and any(_alike(c, o) for o in ranked[:i] if o.own))]
    return [clock for clock in found if any(clock is other for other in kept)]


def _all_clocks(file: File) -> list[Clock]:
    found: list[Clock] = []
    for candidate in file.candidates.get("t", []):
        column = candidate.column or read_label(candidate.series.label)
        unit = "" if column is None else column.unit
        if "t" in file.rig.units:
            unit = file.rig.units["t"].name
        t = candidate.series.values * candidate.factor
        new = Clock(t, candidate.series.group, candidate.words, unit, candidate.series.shown, own=True)
        if not any(_same(new.t, clock.t) and new.group == clock.group for clock in found):
            found.append(new)
    for listed in file.candidates.values():
        for candidate in listed:
            own = candidate.series.clock
            if own is not None and not any(_same(own, clock.t) for clock in found):
                found.append(Clock(own, candidate.series.group, candidate.words, "", candidate.series.shown))
    if not found and file.rig.sample_time is not None:
        sizes = {c.series.values.size for c in file.candidates.get("u", [])}
        found = [Clock(np.arange(size, dtype=np.float64) * file.rig.sample_time, own=True, unit="s") for size in sizes]
    return found


def _clock_of(candidate: Candidate, clocks: list[Clock]) -> Clock | str | None:
    """Return the clock of a column, ``None`` where no clock has its length, or why it cannot be told."""
    own = candidate.series.clock
    if own is not None:
        return next((clock for clock in clocks if _same(clock.t, own)), None)
    fitting = [clock for clock in clocks if clock.t.size == candidate.series.values.size]
    for narrower in (
        [clock for clock in fitting if clock.group == candidate.series.group],
        [clock for clock in fitting if clock.words == candidate.words],
        [clock for clock in fitting if clock.own],
    ):
        if len(fitting) > 1 and narrower:
            fitting = narrower
    if len(fitting) > 1:
        return " and ".join(clock.label for clock in fitting)
    return fitting[0] if fitting else None


def on_one_clock(file: File) -> Roles:
    """Choose the clock of the command and the columns that go with it."""
    clocks = _clocks(file)
    on: list[dict[str, list[Candidate]]] = [{} for _ in clocks]
    doubt = ""
    for signal, listed in file.candidates.items():
        for candidate in listed:
            clock = _clock_of(candidate, clocks) if signal != "t" else None
            if isinstance(clock, str):
                doubt = doubt or f"{candidate.series.shown} may belong to {clock}, all of its length"
            elif clock is not None:
                on[next(k for k, item in enumerate(clocks) if item is clock)].setdefault(signal, []).append(candidate)
    joinable: dict[str, list[tuple[Candidate, Clock]]] = {
        signal: [
            (c, clocks[k]) for k, group in enumerate(on) for c in group.get(signal, []) if c.series.clock is not None
        ]
        for signal in (*MEASURED, "xr")
    }

    def worth(k: int) -> tuple[int, int, int, int]:
        own = [min(c.rank for c in group) for signal, group in on[k].items() if signal in MEASURED]
        rank = min(c.rank for c in on[k]["u"])
        return (bool(own) or any(joinable[name] for name in MEASURED), -rank, len(own), clocks[k].t.size)

    bases = [k for k, group in enumerate(on) if "u" in group]
    if not bases or not worth(best := max(bases, key=worth))[0]:
        raise _unpaired(file, clocks, doubt)
    # structs of equal standing are several runs in one file
    best_of(file, "u", [min(on[k]["u"], key=lambda c: c.rank) for k in bases if worth(k) == worth(best)])
    return _on_clock(file, clocks[best], on[best], joinable)


def _unpaired(file: File, clocks: list[Clock], doubt: str) -> RecordingError:
    """Return the error for a file in which command and measurements have no common clock."""
    if doubt:
        remedy = 'Say which in rig.toml, for example [columns] t = "t_exp".'
        return file.error("time", "each signal must have one clock", doubt, remedy)
    sizes = ", ".join(str(clock.t.size) for clock in clocks)
    for signal in ("u", *MEASURED):
        for candidate in file.candidates.get(signal, []):
            if not any(clock.t.size == candidate.series.values.size for clock in clocks):
                got = f"{candidate.series.values.size} values for {sizes} instants"
                rule, remedy = "must have as many values as time", "Save both from the same run."
                return file.error(f"column {candidate.series.shown}", rule, got, remedy)
    got = f"clocks of {sizes} instants"
    return file.error("time", "command and measurements must have one clock", got, "Save both from the same run.")


def _on_clock(
    file: File,
    clock: Clock,
    own: dict[str, list[Candidate]],
    joinable: dict[str, list[tuple[Candidate, Clock]]],
) -> Roles:
    """Return the signals on one clock, those of other clocks interpolated onto it."""
    notes = list(file.notes)
    chosen = {signal: best_of(file, signal, listed) for signal, listed in own.items()}
    raw = {signal: candidate.series.values for signal, candidate in chosen.items()}
    others = {
        signal: min(listed, key=lambda pair: pair[0].rank)
        for signal, listed in joinable.items()
        if listed and signal not in chosen
    }
    base = clock.t
    if others:
        keep = _overlap(base, [other.t for _, other in others.values()], file)
        base, raw = base[keep], {signal: values[keep] for signal, values in raw.items()}
        for signal, (candidate, other) in others.items():
            raw[signal] = _interpolated(base, other.t, candidate.series.values, signal)
            chosen[signal] = candidate
        if any(not _same(other.t, clock.t) for _, other in others.values()):
            notes.append(f"{len(others)} signals joined on one time base")
    missing = [signal for signal in ("u", *MEASURED, "xr") if signal in file.candidates and signal not in chosen]
    for signal in missing:
        names = ", ".join(dict.fromkeys(c.series.shown for c in file.candidates[signal]))
        notes.append(f"{names} left out: of another length than the command's clock")
    factors = {signal: candidate.factor for signal, candidate in chosen.items()}
    filtered = tuple(s for s, c in chosen.items() if c.column is not None and c.column.origin == "filtered")
    notes += [f"{s} is filtered ({chosen[s].series.shown}): no raw one is in the file" for s in filtered]
    if clock.label and len({c.t.size for c in _clocks(file) if c.own}) > 1:
        notes.append(f"several clocks: the command's is {clock.label}")
    notes += [
        f"no column for {role}, which rig.toml calls {either(called)}"
        for role, called in file.absent.items()
        if role != "reference"  # an open-loop run has none
    ]
    signals = {"t": base} | {
        signal: np.where(np.isfinite(values), values, np.nan) * factors[signal] for signal, values in raw.items()
    }
    return Roles(signals, factors, filtered, clock.unit, tuple(notes))


def best_of(file: File, signal: str, listed: list[Candidate]) -> Candidate:
    """Return the column of the best origin; equal copies are one signal."""
    rank = min(candidate.rank for candidate in listed)
    first, *rest = [candidate for candidate in listed if candidate.rank == rank]
    for other in rest:
        if not _equal(first, other):
            names = f"{first.series.shown} and {other.series.shown}, both {signal}"
            role = ROLE[signal]
            remedy = f'Say in rig.toml which to take: [columns] {role} = "{first.series.shown}"; or remove one.'
            raise file.error(f"column {other.series.shown}", "each signal may appear once", names, remedy)
    return first


def _equal(first: Candidate, second: Candidate) -> bool:
    a, b = first.series.values * first.factor, second.series.values * second.factor
    size = float(np.nanmax(np.abs(a), initial=0.0))
    return a.shape == b.shape and bool(np.allclose(a, b, rtol=0.0, atol=1e-5 * size + 1e-12, equal_nan=True))


def _overlap(base: FloatArray, others: list[FloatArray], file: File) -> slice:
    start, end = max(float(t[0]) for t in others), min(float(t[-1]) for t in others)
    inside = np.flatnonzero((base >= start - 1e-9) & (base <= end + 1e-9))
    if inside.size < 2:
        got = f"no samples between {start:g} s and {end:g} s"
        raise file.error("time", "all signals must cover a common span", got, "Save the signals of one run only.")
    return slice(int(inside[0]), int(inside[-1]) + 1)


def _interpolated(base: FloatArray, t: FloatArray, values: FloatArray, signal: str) -> FloatArray:
    """Return a signal of another clock: measurements interpolated, the reference held."""
    if signal == "xr":
        held = np.searchsorted(t, base + 1e-9, side="right") - 1
        return values[np.clip(held, 0, values.size - 1)]
    return np.interp(base, t, values)

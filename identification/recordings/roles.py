"""Which column of a file plays which role: time, command, positions, velocities, reference.

A rig description names columns; what it does not name is recognised by its name. Where a signal is there more than once,
measured ones come before plain ones, filtered ones after both, and simulated copies are left out. Columns pair with the
clock they were logged with, else with the clock of their length.
"""

from __future__ import annotations

import difflib
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from identification.recordings.columns import (
    MEASURED,
    Column,
    Signal,
    conversion,
    no_unit,
    read_label,
)
from identification.recordings.errors import NotARecordingError, broken
from identification.recordings.names import combined, resolve
from identification.recordings.rig import SIGNAL
from identification.recordings.table import Series

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flexdrive_gym.recording import FloatArray
    from identification.recordings.errors import RecordingError
    from identification.recordings.rig import Rig
    from identification.recordings.table import Table

_ROLE = {signal: role for role, signal in SIGNAL.items()}
MOST_LISTED = 12


@dataclass(frozen=True)
class Roles:
    """The signals of one file.

    Attributes
    ----------
    signals
        In the rig's units, ``t`` among them, each ndarray, shape (n,).
    raw
        The same as the file has them, before any factor.
    factors
        By signal, from ``raw`` to ``signals``.
    filtered
        Velocities that were filtered.
    unit
        Of the time column, as its name says.
    notes
        What was chosen, done and left out.
    """

    signals: dict[str, FloatArray]
    factors: dict[str, float]
    filtered: tuple[str, ...] = ()
    unit: str = ""
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Candidate:
    """A column that may play a role."""

    series: Series
    factor: float
    column: Column | None = None  # none where the description names it

    @property
    def rank(self) -> int:
        return 0 if self.column is None else self.column.rank

    @property
    def words(self) -> frozenset[str]:
        return frozenset() if self.column is None else frozenset(self.column.words)


@dataclass
class _File:
    """What is known of one file while its roles are found."""

    table: Table
    rig: Rig
    source: str
    candidates: dict[str, list[_Candidate]] = field(default_factory=dict)
    absent: dict[str, tuple[str, ...]] = field(default_factory=dict)
    strange: dict[str, Column] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def error(self, what: str, rule: str, got: str, remedy: str) -> RecordingError:
        return broken(self.source, what, rule, got, remedy)

    def shown(self) -> str:
        """The columns that can be named, for messages."""
        names = list(dict.fromkeys(series.shown for series in self.table.series))
        more = f" and {len(names) - MOST_LISTED} more" if len(names) > MOST_LISTED else ""
        return f"columns {', '.join(names[:MOST_LISTED])}{more}" if names else "no columns"


def find_roles(table: Table, rig: Rig, source: str) -> Roles:
    """Find the signals of a file.

    Parameters
    ----------
    table
        Its columns.
    rig
        Description as it holds for this file.
    source
        File name for messages.

    Returns
    -------
    Roles

    Raises
    ------
    NotARecordingError
        If it holds time and reference only.
    RecordingError
        If time, command or every measurement is missing, if a column cannot be had, or if several differ that may play one role.
    """
    file = _File(table, rig, source)
    named = _named(file)
    _recognised(file, named)
    if _only_reference(file):
        rule = "must contain the command and a position or velocity"
        remedy = "This is a reference trajectory, not a recording; leave it out."
        raise NotARecordingError(str(file.error("columns", rule, "time and reference only", remedy)))
    _require(file)
    return _chosen(file)


def _named(file: _File) -> set[int]:
    """Resolve the names of the description; return the series they take."""
    taken: set[int] = set()
    resolved: dict[str, Series] = {}
    for role, names in file.rig.columns.items():
        for name in names:
            parts = resolve(file.table, name)
            if parts is not None:
                resolved[role] = combined(parts, name)
                taken |= {id(series) for _, series in parts}
                break
        else:
            file.absent[role] = names
    for role, series in resolved.items():
        unit = file.rig.units.get(role)
        factor = unit.factor if unit is not None else _own_factor(file, role, read_label(series.label), series.label)
        file.candidates[SIGNAL[role]] = [_Candidate(series, factor)]
    for role, names in file.absent.items():
        _check_absent(file, role, names, taken)
    return taken


def _check_absent(file: _File, role: str, names: tuple[str, ...], taken: set[int]) -> None:
    """Refuse a file that has a column whose name is nearly the one that is wanted: it is misspelt."""
    free = [series.label for series in file.table.series if series.named and id(series) not in taken]
    near = [match for name in names for match in difflib.get_close_matches(name, free, n=1, cutoff=0.8)]
    if near:
        rule = f"rig.toml gives {role} the name {_either(names)}"
        raise file.error(f"columns {role}", rule, file.shown(), f'Is {near[0]} meant? Write {role} = "{near[0]}".')


def _either(names: Sequence[str]) -> str:
    return " or ".join(f"'{name}'" for name in names)


def _wanted_unit(rig: Rig, role: str) -> str:
    """Return the rig's unit of a role."""
    length, command = rig.unit_names()
    return {"t": "s", "u": command, "v1": f"{length}/s", "v2": f"{length}/s"}.get(role, length)


def _own_factor(file: _File, role: str, column: Column | None, label: str) -> float:
    """Return the factor to the rig's unit that a column's own name implies."""
    if column is None:
        return 1.0
    wanted = _wanted_unit(file.rig, role)
    factor = conversion(column, wanted)
    if factor is None:
        raise no_unit(file.source, label, column.signal, column.unit, wanted)
    return factor


def _recognised(file: _File, taken: set[int]) -> None:
    """Add the columns that their own names tell, for the roles that the description does not name."""
    ignored = []
    for series in file.table.series:
        if id(series) in taken:
            continue
        column = read_label(series.label) if series.named else None
        if column is None:
            ignored.append(series.shown)
            continue
        role = _ROLE[column.signal]
        if role in file.rig.columns:
            continue
        unit = file.rig.units.get(role)
        factor = unit.factor if unit is not None else conversion(column, _wanted_unit(file.rig, role))
        if factor is None:
            file.strange.setdefault(column.signal, column)
            ignored.append(series.shown)
        elif column.origin == "simulated":
            ignored.append(series.shown)
        else:
            file.candidates.setdefault(column.signal, []).append(_Candidate(series, factor, column))
    if ignored:
        more = f" and {len(ignored) - MOST_LISTED} more" if len(ignored) > MOST_LISTED else ""
        file.notes.append(f"columns ignored: {', '.join(ignored[:MOST_LISTED])}{more}")


def _only_reference(file: _File) -> bool:
    return set(file.candidates) == {"t", "xr"} and not file.strange


def _require(file: _File) -> None:
    """Check that time, command and a measurement are there, wherever they stand."""
    clocked = any(series.clock is not None for series in file.table.series)
    timed = clocked or file.rig.sample_time is not None or "t" in file.candidates
    for there, wanted, meaning, example in (
        (timed, ("t",), "time", "t_s"),
        ("u" in file.candidates, ("u",), "the command", "u_V"),
        (any(n in file.candidates for n in MEASURED), MEASURED, "at least one of x1, x2, v1, v2", "x1_mm"),
    ):
        if not there:
            raise _missing(file, wanted, meaning, example)


def _missing(file: _File, wanted: Sequence[Signal], meaning: str, example: str) -> RecordingError:
    for signal in wanted:
        strange = file.strange.get(signal)
        if strange is not None:
            role = _ROLE[signal]
            return no_unit(file.source, strange.label, signal, strange.unit, _wanted_unit(file.rig, role))
        tail = _strange_tail(file.table, signal)
        if tail is not None:
            return no_unit(file.source, tail[0], signal, tail[1], _wanted_unit(file.rig, _ROLE[signal]))
    rule = f"must contain {meaning}"
    names = [name for signal in wanted for name in file.absent.get(_ROLE[signal], ())]
    if names:
        rule += f", which rig.toml calls {_either(names)}"
    labels = [series.label for series in file.table.series if series.named]
    near = difflib.get_close_matches(example.lower(), [label.lower() for label in labels], n=1, cutoff=0.6)
    hint = f" Is {near[0]} meant?" if near and read_label(near[0]) is None else ""
    role = _ROLE[wanted[0]]
    if not labels and file.table.hints and not names:
        remedy = f'Say in rig.toml which column is which, by number from 1 to {len(file.table.series)}: [columns] {role} = "1".'
        return file.error("header", "the first line must name the columns", file.table.hints[0], remedy)
    hint += "".join(f" {item[0].upper()}{item[1:]}." for item in (*file.table.hints, *file.table.remarks))
    remedy = (
        f'Name that column {example}, unit included, or say in rig.toml which it is: [columns] {role} = "its name".'
    )
    if wanted == ("t",):
        remedy += " Without any, write the sampling period: [rig] sample_time = 0.001."
    return file.error("columns", rule, file.shown(), remedy + hint)


def _strange_tail(table: Table, signal: Signal) -> tuple[str, str] | None:
    """Return a name that is a signal and something else, which is no unit of it, with that tail."""
    for series in table.series:
        if not series.named or read_label(series.label) is not None:
            continue
        for cut in re.finditer(r"[\s_/,.:-]+", series.label):
            head = read_label(series.label[: cut.start()])
            if head is not None and head.signal == signal:
                return series.label, series.label[cut.end() :]
    return None


@dataclass(frozen=True)
class _Clock:
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


def _clocks(file: _File) -> list[_Clock]:
    """Return the distinct clocks of a file, those of its columns first."""
    found: list[_Clock] = []
    for candidate in file.candidates.get("t", []):
        column = candidate.column or read_label(candidate.series.label)
        unit = "" if column is None else column.unit
        if "t" in file.rig.units:
            unit = file.rig.units["t"].name
        t = candidate.series.values * candidate.factor
        new = _Clock(t, candidate.series.group, candidate.words, unit, candidate.series.shown, own=True)
        if not any(_same(new.t, clock.t) and new.group == clock.group for clock in found):
            found.append(new)
    for listed in file.candidates.values():
        for candidate in listed:
            own = candidate.series.clock
            if own is not None and not any(_same(own, clock.t) for clock in found):
                found.append(_Clock(own, candidate.series.group, candidate.words, "", candidate.series.shown))
    if not found and file.rig.sample_time is not None:
        sizes = {c.series.values.size for c in file.candidates.get("u", [])}
        found = [_Clock(np.arange(size, dtype=np.float64) * file.rig.sample_time, own=True, unit="s") for size in sizes]
    return found


def _clock_of(candidate: _Candidate, clocks: list[_Clock]) -> _Clock | str | None:
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


def _chosen(file: _File) -> Roles:
    """Choose the clock of the command and the columns that go with it."""
    clocks = _clocks(file)
    on: list[dict[str, list[_Candidate]]] = [{} for _ in clocks]
    doubt = ""
    for signal, listed in file.candidates.items():
        for candidate in listed:
            clock = _clock_of(candidate, clocks) if signal != "t" else None
            if isinstance(clock, str):
                doubt = doubt or f"{candidate.series.shown} may belong to {clock}, all of its length"
            elif clock is not None:
                on[next(k for k, item in enumerate(clocks) if item is clock)].setdefault(signal, []).append(candidate)
    joinable: dict[str, list[tuple[_Candidate, _Clock]]] = {
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
    _best(file, "u", [min(on[k]["u"], key=lambda c: c.rank) for k in bases if worth(k) == worth(best)])
    return _on_clock(file, clocks[best], on[best], joinable)


def _unpaired(file: _File, clocks: list[_Clock], doubt: str) -> RecordingError:
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
    file: _File,
    clock: _Clock,
    own: dict[str, list[_Candidate]],
    joinable: dict[str, list[tuple[_Candidate, _Clock]]],
) -> Roles:
    """Return the signals on one clock, those of other clocks interpolated onto it."""
    notes = list(file.notes)
    chosen = {signal: _best(file, signal, listed) for signal, listed in own.items()}
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
        f"no column for {role}, which rig.toml calls {_either(called)}"
        for role, called in file.absent.items()
        if role != "reference"  # an open-loop run has none
    ]
    signals = {"t": base} | {
        signal: np.where(np.isfinite(values), values, np.nan) * factors[signal] for signal, values in raw.items()
    }
    return Roles(signals, factors, filtered, clock.unit, tuple(notes))


def _best(file: _File, signal: str, listed: list[_Candidate]) -> _Candidate:
    """Return the column of the best origin; equal copies are one signal."""
    rank = min(candidate.rank for candidate in listed)
    first, *rest = [candidate for candidate in listed if candidate.rank == rank]
    for other in rest:
        if not _equal(first, other):
            names = f"{first.series.shown} and {other.series.shown}, both {signal}"
            role = _ROLE[signal]
            remedy = f'Say in rig.toml which to take: [columns] {role} = "{first.series.shown}"; or remove one.'
            raise file.error(f"column {other.series.shown}", "each signal may appear once", names, remedy)
    return first


def _equal(first: _Candidate, second: _Candidate) -> bool:
    a, b = first.series.values * first.factor, second.series.values * second.factor
    size = float(np.nanmax(np.abs(a), initial=0.0))
    return a.shape == b.shape and bool(np.allclose(a, b, rtol=0.0, atol=1e-5 * size + 1e-12, equal_nan=True))


def _overlap(base: FloatArray, others: list[FloatArray], file: _File) -> slice:
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

"""Which column of a file plays which role: time, command, positions, velocities, reference.

A rig description names columns; what it does not name is recognised by its name. Where a signal is there more than once,
measured ones come before plain ones, filtered ones after both, and simulated copies are left out. What fits is brought on one
clock by :mod:`identification.recordings.one_clock`.
"""

from __future__ import annotations

import difflib
import re
from typing import TYPE_CHECKING, cast

import numpy as np

from identification.recordings.candidates import MOST_LISTED, ROLE, Candidate, File, either
from identification.recordings.columns import (
    LIMITED,
    MEASURED,
    conversion,
    kind_of,
    no_unit,
    no_volts,
    read_label,
    unit_remedy,
    with_unit,
)
from identification.recordings.errors import NotARecordingError
from identification.recordings.names import combined, resolve
from identification.recordings.one_clock import on_one_clock
from identification.recordings.rig import SIGNAL

if TYPE_CHECKING:
    from collections.abc import Sequence

    from identification.recordings.candidates import Roles
    from identification.recordings.columns import Column, Signal
    from identification.recordings.errors import RecordingError
    from identification.recordings.rig import Rig
    from identification.recordings.table import Series, Table


# share of its range by which a limited command may miss the limits, and of the samples that may, for one comes a sample later
_ALIKE, _UNLIKE = 0.02, 0.1


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
    file = File(table, rig, source)
    named = _named(file)
    _recognised(file, named)
    if _only_reference(file):
        rule = "must contain the command and a position or velocity"
        remedy = "This is a reference trajectory, not a recording; leave it out."
        raise NotARecordingError(str(file.error("columns", rule, "time and reference only", remedy)))
    _require(file)
    return on_one_clock(file)


def _named(file: File) -> set[int]:
    """Resolve the names of the description; return the series they take."""
    taken: set[int] = set()
    resolved: dict[str, tuple[Series, Column]] = {}
    for role, names in file.rig.columns.items():
        for name in names:
            parts = resolve(file.table, name)
            if parts is not None:
                resolved[role] = combined(parts, name), _column_of(file, role, name, [series for _, series in parts])
                taken |= {id(series) for _, series in parts}
                break
        else:
            file.absent[role] = names
    for role, (series, own) in resolved.items():
        file.candidates[SIGNAL[role]] = [Candidate(series, _own_factor(file, role, own, series.label))]
    for role, names in file.absent.items():
        _check_absent(file, role, names, taken)
    return taken


def _column_of(file: File, role: str, name: str, parts: Sequence[Series]) -> Column:
    """Return what the names of the columns that make a role say of it; those of a sum must be in one unit."""
    signal = cast("Signal", SIGNAL[role])
    columns = [with_unit(series.label if series.named else "", signal) for series in parts]
    units = list(dict.fromkeys(column.unit for column in columns))
    if len(units) > 1:
        remedy = "Convert one of the columns and rename it."
        raise file.error(f"columns {role}", f"'{name}' must be a sum of one unit", ", ".join(units), remedy)
    return columns[0]


def _check_absent(file: File, role: str, names: tuple[str, ...], taken: set[int]) -> None:
    """Refuse a file that has a column whose name is nearly the one that is wanted: it is misspelt."""
    free = [series.label for series in file.table.series if series.named and id(series) not in taken]
    near = [match for name in names for match in difflib.get_close_matches(name, free, n=1, cutoff=0.8)]
    if near:
        rule = f"rig.toml gives {role} the name {either(names)}"
        raise file.error(f"columns {role}", rule, file.shown(), f'Is {near[0]} meant? Write {role} = "{near[0]}".')


def _wanted_unit(rig: Rig, role: str) -> str:
    """Return the rig's unit of a role."""
    length, command = rig.unit_names()
    return {"t": "s", "u": command, "v1": f"{length}/s", "v2": f"{length}/s"}.get(role, length)


def _own_factor(file: File, role: str, column: Column, label: str) -> float:
    """Return the factor to the rig's unit: as the description has it, else as the column's own name says."""
    factor = _factor(file, role, column)
    if factor is None:
        raise no_unit(file.source, label, column.signal, column.unit, _wanted_unit(file.rig, role))
    return factor


def _factor(file: File, role: str, column: Column) -> float | None:
    """Return the factor to the rig's unit, or ``None`` where nothing tells it."""
    unit, factor = file.rig.units.get(role), conversion(column, _wanted_unit(file.rig, role))
    if unit is None or (unit.factor is None and factor is not None):
        return factor
    if unit.factor is None:
        file.notes.append(f"{column.label}: the name says {column.unit}, rig.toml {unit.name}, which holds")
    return 1.0 if unit.factor is None else unit.factor


def _recognised(file: File, taken: set[int]) -> None:
    """Add the columns that their own names tell, for the roles that the description does not name."""
    ignored, counted = [], _counted_from_zero(file.table)
    if counted:
        file.notes.append(f"{', '.join(counted)}: carts are counted from 0 and read as carts 1 and 2")
    for series in file.table.series:
        if id(series) in taken:
            continue
        column = read_label(counted.get(series.label, series.label)) if series.named else None
        if column is None:
            ignored.append(series.shown)
            continue
        role = ROLE[column.signal]
        if role in file.rig.columns:
            continue
        factor = _factor(file, role, column)
        if factor is None:
            file.strange.setdefault(column.signal, column)
            ignored.append(series.shown)
        elif column.origin == "simulated":
            ignored.append(series.shown)
        else:
            file.candidates.setdefault(column.signal, []).append(Candidate(series, factor, column))
            if no_volts(column) and "u" not in file.rig.units:
                said = f"warning: {series.shown} says no unit and is read in {_wanted_unit(file.rig, role)}"
                file.notes.append(f'{said}. Name it in rig.toml, for example [units] u = {{ unit = "N m" }}')
    ignored += _no_commands(file)
    if ignored:
        more = f" and {len(ignored) - MOST_LISTED} more" if len(ignored) > MOST_LISTED else ""
        file.notes.append(f"columns ignored: {', '.join(ignored[:MOST_LISTED])}{more}")
    for signal in MEASURED:
        column = file.strange.get(signal)
        tail = (column.label, column.unit) if column is not None else _strange_tail(file.table, signal)
        if tail is not None and tail[0] in ignored and signal not in file.candidates:
            remedy = unit_remedy(tail[0], signal, tail[1], _wanted_unit(file.rig, ROLE[signal]))
            file.notes.append(f"{tail[0]}: {tail[1]!r} is no known unit of {signal}. {remedy}")


def _no_commands(file: File) -> list[str]:
    """Leave out columns that are called limited commands and are none, such as flags and limits; return their names."""
    found = file.candidates.get("u", [])
    limited = [c for c in found if c.words & LIMITED]
    asked = [c for c in found if c not in limited]
    none = [c for c in limited if asked and not any(_limits(c, other) for other in asked)]
    if none:
        file.candidates["u"] = [c for c in found if c not in none]
    elif limited and asked:
        file.notes.append(
            f"{limited[0].series.shown} is read as the command, {asked[0].series.shown} as what was asked for"
        )
    return [c.series.shown for c in none]


def _limits(limited: Candidate, asked: Candidate) -> bool:
    """Whether a command is another one between limits."""
    own, other = limited.series.values * limited.factor, asked.series.values * asked.factor
    if own.shape != other.shape or not np.isfinite(own).any():
        return False
    low, high = float(np.nanmin(own)), float(np.nanmax(own))
    near = np.abs(np.clip(other, low, high) - own) <= _ALIKE * (high - low)
    return high > low and float(np.mean(near)) > 1.0 - _UNLIKE


def _counted_from_zero(table: Table) -> dict[str, str]:
    """Return names whose carts are counted from zero, each with the one that counts from one."""
    labels = {series.label: series for series in table.series if series.named}
    found: dict[str, str] = {}
    for label, series in labels.items():
        one, two = (label.replace("0", digit) for digit in "12")
        if label.count("0") != 1 or one not in labels or two in labels:
            continue
        first, second = read_label(one), read_label(two)
        pair = (first.signal if first else "", second.signal if second else "")
        finite = series.values[np.isfinite(series.values)]
        # what does not change is where a cart began
        if pair in {("x1", "x2"), ("v1", "v2")} and finite.size and np.ptp(finite) > 0.0:
            found |= {label: one, one: two}
    return found


def _only_reference(file: File) -> bool:
    return set(file.candidates) == {"t", "xr"} and not file.strange


def _require(file: File) -> None:
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


def _missing(file: File, wanted: Sequence[Signal], meaning: str, example: str) -> RecordingError:
    for signal in wanted:
        strange = file.strange.get(signal)
        if strange is not None:
            role = ROLE[signal]
            return no_unit(file.source, strange.label, signal, strange.unit, _wanted_unit(file.rig, role))
        tail = _strange_tail(file.table, signal)
        if tail is not None:
            return no_unit(file.source, tail[0], signal, tail[1], _wanted_unit(file.rig, ROLE[signal]))
    rule = f"must contain {meaning}"
    names = [name for signal in wanted for name in file.absent.get(ROLE[signal], ())]
    if names:
        rule += f", which rig.toml calls {either(names)}"
    labels = [series.label for series in file.table.series if series.named]
    near = difflib.get_close_matches(example.lower(), [label.lower() for label in labels], n=1, cutoff=0.6)
    hint = f" Is {near[0]} meant?" if near and read_label(near[0]) is None else ""
    role = ROLE[wanted[0]]
    if not labels and file.table.hints and not names:
        remedy = f'Say in rig.toml which column is which, by number from 1 to {len(file.table.series)}: [columns] {role} = "1".'
        return file.error("header", "the first line must name the columns", file.table.hints[0], remedy)
    hint += "".join(f" {item[0].upper()}{item[1:]}." for item in (*file.table.hints, *file.table.remarks))
    remedy = (
        f'Name that column {example}, unit included, or say in rig.toml which it is: [columns] {role} = "its name".'
    )
    if wanted == ("t",):
        remedy += " Without any, write the sampling period: [rig] sample_time = 0.001."
    if told := _by_units(file):
        remedy = f"Say in rig.toml what they are; by their units, under [columns] a line each: {told}."
    return file.error("columns", rule, file.shown(), remedy + hint)


def _by_units(file: File) -> str:
    """Return what columns of unknown names may be, by the units that they have, where these tell all that is missing."""
    free = [s.label for s in file.table.series if s.named and read_label(s.label) is None]
    kinds = {label: kind_of(label) for label in free}
    found = {}
    missing = [signal for signal in ("t", "u") if signal not in file.candidates]
    missing += [] if any(signal in file.candidates for signal in MEASURED) else ["x1"]
    for signal, kind in (("t", "time"), ("u", "voltage")):
        fitting = [label for label in free if kinds[label] == kind]
        if signal in missing and len(fitting) == 1:
            found[signal] = fitting[0]
    for kind, names in (("length", ("x1", "x2")), ("velocity", ("v1", "v2"))):
        fitting = [label for label in free if kinds[label] == kind]
        if "x1" in missing and len(fitting) <= len(names):
            found |= dict(zip(names, fitting, strict=False))
    measured = any(signal in found for signal in MEASURED)
    whole = all(signal in found or (signal == "x1" and measured) for signal in missing)
    return "; ".join(f'{ROLE[signal]} = "{label}"' for signal, label in found.items()) if whole else ""


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

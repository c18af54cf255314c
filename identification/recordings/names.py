"""What the names in a rig description stand for: a column, one of a matrix, a sum."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from identification.recordings.table import Series

if TYPE_CHECKING:
    from identification.recordings.table import Table

_SUM = re.compile(r"\s+([+-])\s+")
_MATRIX = re.compile(r"^(?P<name>.*?)\s*(?::\s*(?P<a>\d+)|\(\s*(?::\s*,)?\s*(?P<b>\d+)\s*\))$")


def resolve(table: Table, name: str) -> list[tuple[float, Series]] | None:
    """Return the series, with their signs, that a name in a description stands for."""
    whole = _one(table, name)
    if whole is not None:
        return [(1.0, whole)]
    pieces = _SUM.split(name)
    if len(pieces) == 1:
        return None
    signs = [1.0, *(1.0 if mark == "+" else -1.0 for mark in pieces[1::2])]
    found = [_one(table, piece) for piece in pieces[::2]]
    if any(series is None for series in found):
        return None
    return [(sign, series) for sign, series in zip(signs, found, strict=True) if series is not None]


def _one(table: Table, name: str) -> Series | None:
    wanted = name.strip()
    for series in table.series:
        if series.named and series.label == wanted:
            return series
    matrix = _MATRIX.match(wanted)
    places = {wanted} | ({f"{matrix['name']}:{matrix['a'] or matrix['b']}"} if matrix else set())
    found = [series for series in table.series if places & set(series.places)]
    if not found and wanted.isdigit():  # a column of the only matrix
        found = [s for s in table.series if not s.named and any(p.rpartition(":")[2] == wanted for p in s.places[:1])]
        found = found if len(found) == 1 else []
    if not found:
        plain = _plain(wanted)
        found = [
            s for s in table.series if s.named and plain and plain in {_plain(s.label), _plain(s.label.split("[")[0])}
        ]
    return found[0] if found else None


def _plain(name: str) -> str:
    return re.sub(r"[\s_]+", "", name).lower()


def combined(parts: list[tuple[float, Series]], name: str) -> Series:
    """Return the sum that a description writes."""
    sign, first = parts[0]
    if len(parts) == 1 and sign > 0.0:
        return first
    size = min(series.values.size for _, series in parts)
    if any(series.values.size != size for _, series in parts):
        return Series(name, np.full(0, np.nan), first.clock)
    total = np.sum([sign * series.values for sign, series in parts], axis=0)
    return Series(name, total, first.clock, first.group)

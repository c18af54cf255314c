"""Tables for a terminal of any width: a number or a word is never broken.

Where a table is too wide, its texts are wrapped between words; then a long text at its end moves onto lines of its own below each
row; then the columns are split over several tables, each of which begins with the columns that name the rows.
"""

from __future__ import annotations

import os
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

_GAP = 2
_INDENT = "    "
# a text is not wrapped into a column narrower than this, and what is shorter is left on one line
_LEAST_TEXT = 24
# a cell that begins as a number does, and is longer, is a sentence
_LONGEST_NUMBER = 32
PIPED_WIDTH = 140


def columns_given() -> int | None:
    """Return the width that the environment asks for by ``COLUMNS``, or ``None``."""
    asked = os.environ.get("COLUMNS", "")
    return int(asked) if asked.isdecimal() and int(asked) >= 20 else None


@dataclass(frozen=True)
class _Column:
    """A column: its cells, and how narrow it may become."""

    name: str
    cells: tuple[str, ...]
    numeric: bool

    @property
    def natural(self) -> int:
        return max(map(len, (self.name, *self.cells)))

    @property
    def least(self) -> int:
        words = max((len(word) for word in self.name.split()), default=0)
        if self.numeric:
            return max([words, *map(len, self.cells)])
        longest = max((len(word) for cell in self.cells for word in cell.split()), default=0)
        return max(words, longest, min(_LEAST_TEXT, max(map(len, self.cells), default=0)))


def _column(name: str, cells: Sequence[str], place: int) -> _Column:
    numeric = place > 0 and all(
        not cell or (cell[0] in "-+−±–0123456789<>≤≥" and len(cell) <= _LONGEST_NUMBER) for cell in cells
    )
    return _Column(name, tuple(cells), numeric)


def laid_out(columns: Sequence[str], rows: Iterable[Sequence[str]], width: int) -> list[list[str]]:
    """Return a table as one or more sheets of lines, none wider than ``width`` unless a single number or word is.

    Parameters
    ----------
    columns
        Headers.
    rows
        Cells, as many a row as there are columns.
    width
        In characters.

    Returns
    -------
    list of list of str
        Sheets; the first lines of each, as many as its header needs, end with a line of dashes.
    """
    body = [tuple(row) for row in rows]
    table = [_column(name, [row[i] for row in body], i) for i, name in enumerate(columns)]
    if _fits(table, width):
        return [_sheet(table, (), width)]
    last = table[-1]
    # a remark, and not just another cell
    if len(table) > 2 and not last.numeric and last.natural > _LEAST_TEXT and _fits(table[:-1], width):
        return [_sheet(table[:-1], last.cells, width, last.name)]
    # rows that the first column does not tell apart are named by the second too
    named = 2 if len(table) > 2 and len(set(table[0].cells)) < len(body) and _fits(table[:3], width) else 1
    names, others = table[:named], table[named:]
    groups: list[list[_Column]] = [[]]
    for column in others:
        if groups[-1] and not _fits([*names, *groups[-1], column], width):
            groups.append([])
        groups[-1].append(column)
    return [_sheet([*names, *group], (), width) for group in groups]


def _fits(table: Sequence[_Column], width: int) -> bool:
    return sum(c.least for c in table) + _GAP * (len(table) - 1) <= width


def _sheet(table: Sequence[_Column], below: Sequence[str], width: int, name: str = "") -> list[str]:
    widths = [c.least for c in table]
    spare = width - sum(widths) - _GAP * (len(table) - 1)
    while spare > 0 and any(w < c.natural for w, c in zip(widths, table, strict=True)):
        # the column that wraps most gets the next character
        i = max(range(len(table)), key=lambda j: table[j].natural - widths[j])
        widths[i], spare = widths[i] + 1, spare - 1
    lines = _row([c.name for c in table], table, widths)
    if name:
        lines += _wrapped(name, width, _INDENT)
    lines.append("─" * min(width, sum(widths) + _GAP * (len(table) - 1)))
    for i in range(len(table[0].cells)):
        lines += _row([c.cells[i] for c in table], table, widths)
        if below and below[i]:
            lines += _wrapped(below[i], width, _INDENT)
    return lines


def _row(cells: Sequence[str], table: Sequence[_Column], widths: Sequence[int]) -> list[str]:
    parts = [_wrapped(cell, w) or [""] for cell, w in zip(cells, widths, strict=True)]
    lines = []
    for i in range(max(map(len, parts))):
        texts = [part[i] if i < len(part) else "" for part in parts]
        padded = [
            text.rjust(w) if column.numeric else text.ljust(w)
            for text, w, column in zip(texts, widths, table, strict=True)
        ]
        lines.append((" " * _GAP).join(padded).rstrip())
    return lines


def _wrapped(text: str, width: int, indent: str = "", more: str | None = None) -> list[str]:
    return textwrap.wrap(
        text, width, initial_indent=indent, subsequent_indent=indent if more is None else more,
        break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip


def wrapped_sentence(text: str, width: int) -> str:
    """Return a sentence wrapped between words; what it begins with, blanks or a dash, is kept clear on later lines."""
    rest = text.lstrip(" ")
    indent = text[: len(text) - len(rest)]
    more = indent + ("  " if rest.startswith("- ") else "")
    return "\n".join(_wrapped(rest, width, indent, more))

"""How the lines of a text file are to be cut: separator, decimal sign, names of the columns, and where the data begin.

Data begin below names of signals, or where most of the next lines hold numbers alike: a number in prose, or a setting of the
logger, is no table. What stands above is the header, and between both may stand units.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from identification.recordings.columns import read_label
from identification.recordings.errors import NotARecordingError, broken

if TYPE_CHECKING:
    from collections.abc import Iterable

_NUMBER = re.compile(r"^[+-]?(\d+([.,]\d*)?|[.,]\d+)([ed][+-]?\d+)?$|^[+-]?(nan|inf(inity)?)$", re.IGNORECASE)
_DATE = re.compile(r"^\d{1,4}[-/.]\w{1,3}[-/.]\d{1,4}([ T]\d.*)?$|^\d{1,2}:\d{2}(:\d{2}([.,]\d+)?)?$|^\d{4}-\d\d-\d\dT")
_DECIMAL_COMMA = re.compile(r"^[+-]?[\d.]*,\d+([ed][+-]?\d+)?$", re.IGNORECASE)
EXPONENT = re.compile(r"(?<=\d)[dD](?=[+-]?\d+$)")  # as Fortran writes it
BLANK = r"\s+"
COMMENT = ("#", "%", "//", "'")
_UNITS_FOLLOW = re.compile(r"^\s*units?\s*[:=]\s*", re.IGNORECASE)
MOST_HEADER = 400  # lines above the data
_MOST_ROWS = 5000  # lines that tell a decimal sign
_LIKE, _MOST_LIKE = 20, 0.7  # lines below the first one, and how many of them must be data, too
WIDEST = 4096  # columns


@dataclass(frozen=True)
class Dialect:
    """How the lines of a file are to be cut, and where the data begin."""

    separator: str
    count: int
    first: int
    header: tuple[str, ...]
    named: bool
    comma: bool = False


def dialect_of(lines: list[str], source: str) -> Dialect:
    """Find where data begin, how they are separated and what the columns are called."""
    above: list[str] = []
    for place, line in enumerate(lines):
        bare = line.strip()
        if not bare:
            continue
        if not bare.startswith(COMMENT):
            found = cut(line)
            if found is not None and (_names_signals(above) or _begins(lines, place, found)):
                return _named(above, lines, place, *found)
            if len(above) >= MOST_HEADER:
                break
        above.append(line)
    if not above:
        raise broken(source, "file", "must hold a header and samples", "no lines", "Record the run again.")
    if all(line.strip().startswith(COMMENT) for line in above):
        remedy = "Record the run again."
        raise NotARecordingError(str(broken(source, "file", "must hold a header and samples", "comments only", remedy)))
    if _names_signals(above):
        raise broken(source, "file", "must hold samples below the header", "none", "Record the run again.")
    error = broken(source, "file", "must hold columns of numbers", f"'{above[0].strip()[:60]}'", "Leave it out.")
    raise NotARecordingError(str(error))


def _separator_of(line: str) -> str:
    # a semicolon or tab outranks the comma, which may then be the decimal sign
    return next((mark for mark in (";", "\t", ",") if mark in line), BLANK)


def _cells(line: str, separator: str) -> list[str]:
    if separator != "\t":
        line = line.strip()
    parts = re.split(separator, line) if separator == BLANK else line.split(separator)
    return [cell.strip().strip("\"'").strip() for cell in parts]


def cut(line: str) -> tuple[str, int, bool] | None:
    """Return separator, number of columns and whether the comma is the decimal sign, or ``None`` for a line without data."""
    if '"' in line and re.search(r'"[+-]?\d*,\d+"', line):
        cells = re.findall(r'"([^"]*)"', line)
        return (",", len(cells), True) if len(cells) > 1 else None
    marks = [mark for mark in (";", "\t", ",") if mark in line] + [BLANK]
    if marks[0] == "," and _blank_with_decimal_comma(line):
        marks = [BLANK]
    for mark in marks:
        cells = _cells(line, mark)
        while len(cells) > 1 and not cells[-1]:
            cells.pop()
        filled = [cell for cell in cells if cell]
        numbers = sum(bool(_NUMBER.match(cell) or _DATE.match(cell)) for cell in filled)
        if len(cells) > 1 and numbers and 2 * numbers >= len(filled) and len(cells) <= WIDEST:
            comma = mark != "," and any(_DECIMAL_COMMA.match(cell) for cell in filled)
            return mark, len(cells), comma
    return None


def _blank_with_decimal_comma(line: str) -> bool:
    cells = line.split()
    return len(cells) > 1 and all(re.match(r"^[+-]?\d+(,\d+)?$", cell) for cell in cells) and "," in line


def _names_signals(above: list[str]) -> bool:
    """Whether the last line has names of several signals."""
    cells = _cells(above[-1], _separator_of(above[-1])) if above else []
    return len({column.signal for column in map(read_label, cells) if column is not None}) > 1


def _begins(lines: list[str], place: int, found: tuple[str, int, bool]) -> bool:
    """Whether most of the next lines are of the same kind: a number in prose, or a setting of the logger, is no table."""
    like, seen = 0, 0
    for line in lines[place + 1 :]:
        if seen >= _LIKE:
            break
        if not line.strip() or line.strip().startswith(COMMENT):
            continue
        seen += 1
        other = cut(line)
        same = other is not None and other[0] == found[0] and abs(other[1] - found[1]) <= 1
        like += same and worded(line, found[0]) == worded(lines[place], found[0])
    return seen > 0 and like >= _MOST_LIKE * seen


def worded(line: str, separator: str) -> bool:
    """Whether a line begins with a word."""
    first = _cells(line, separator)[0]
    return bool(first) and not _NUMBER.match(first) and not _DATE.match(first)


def _named(above: list[str], lines: list[str], place: int, separator: str, count: int, comma: bool) -> Dialect:
    """Return the dialect with the names of the columns, from the lines above the data."""
    candidates = [line.strip().lstrip("#%/' ") if line.strip().startswith(COMMENT) else line for line in above]
    candidates = [_UNITS_FOLLOW.sub("", line) for line in candidates[-6:]]
    units: list[str] | None = None
    for place_above, line in reversed(list(enumerate(candidates))):
        names = _header(line, separator, count)
        if names is None and separator == BLANK:
            names = _header(line, separator, count - 1)
            names = names if names is not None and _numbered(lines[place:], separator) else None
        if names is None:
            continue
        if len(names) == count - 1 and _numbered(lines[place:], separator):
            names = ["", *names]
        if units is None and _are_units(names):
            units = names
            continue
        if units is None and place_above > 0:
            higher = _header(candidates[place_above - 1], separator, count)
            units = higher if higher is not None and len(higher) == len(names) and _are_units(higher) else None
        width = max(count, len(names))
        names += [""] * (width - len(names))
        if units is not None:
            names = [_with_unit(name, unit) for name, unit in zip(names, units + [""] * width, strict=False)]
        return Dialect(separator, width, place, tuple(names), named=True, comma=comma)
    return Dialect(separator, count, place, tuple(str(k + 1) for k in range(count)), named=False, comma=comma)


def _numbered(lines: list[str], separator: str) -> bool:
    """Whether rows begin with their number, and time comes second: such a first column often has no name."""
    rows = [_cells(line, separator)[:2] for line in lines[:_LIKE] if line.strip()]
    if len(rows) < 3 or not all(len(row) == 2 and row[0].isdigit() and _NUMBER.match(row[1]) for row in rows):
        return False
    number, time = [int(row[0]) for row in rows], [float(EXPONENT.sub("e", row[1].replace(",", "."))) for row in rows]
    pairs = range(1, len(rows))
    return all(number[i] == number[i - 1] + 1 for i in pairs) and all(time[i] > time[i - 1] for i in pairs)


def _with_unit(name: str, unit: str) -> str:
    bare = unit.strip("[](){} ")
    known = read_label(name)
    return f"{name} [{bare}]" if bare and (known is None or not known.unit) else name


def _are_units(names: list[str]) -> bool:
    """Whether a line names units, not signals."""
    filled = [name for name in names if name]
    bare = [name.strip("[](){} ") for name in filled]
    bracketed = all(name[0] in "[({" and name[-1] in "])}" for name in filled)
    return bracketed or (
        {"s", "ms", "sec", "seconds", "us"} & {name.lower() for name in bare} != set()
        and all(len(name) < 12 and re.match(r"^[\w/µμ°%^·.* -]*$", name) is not None for name in bare)
        and sum(read_label(name) is not None for name in bare) < 2
    )


def _header(line: str, separator: str, count: int) -> list[str] | None:
    """Return the names in a line, if it has about as many as there are columns."""
    for mark in (separator, _separator_of(line), r"\s{2,}|\t", BLANK):
        cells = re.split(mark, line.strip()) if mark.startswith("\\s") else _cells(line, mark)
        cells = [cell.strip().strip("\"'").strip() for cell in cells]
        while len(cells) > 1 and not cells[-1]:
            cells.pop()
        # a trailing separator under the header, or samples that end early
        fits = len(cells) == count or (mark == separator != BLANK and count - 1 <= len(cells) <= count + 2)
        words = [cell for cell in cells if cell and not _NUMBER.match(cell)]
        if fits and len(cells) > 1 and 2 * len(words) > len([cell for cell in cells if cell]):
            return cells
    return None


def parts_thousands(cells: Iterable[str], mark: str) -> bool:
    """Whether a mark parts thousands: it does where only whole numbers from 1000 on have it, and three digits follow."""
    cells = list(cells)
    marked = [cell for cell in cells if mark in cell]
    whole = re.compile(rf"^[+-]?[1-9]\d{{0,2}}(\{mark}\d{{3}})+$")
    return (
        0 < len(marked) < len(cells)
        and all(whole.match(cell) for cell in marked)
        and all(re.match(r"^[+-]?\d{0,3}$", cell) for cell in cells if mark not in cell)
    )


def decimal_commas(lines: list[str], dialect: Dialect) -> bool:
    """Whether commas are decimal signs: in a column of numbers they part no thousands."""
    rows = [_cells(line, dialect.separator) for line in lines[:_MOST_ROWS]]
    columns = ([row[k] for row in rows if k < len(row)] for k in range(dialect.count))
    return any(any(map(_DECIMAL_COMMA.match, cells)) and not parts_thousands(cells, ",") for cells in columns)

"""Text to columns of numbers: any separator, either decimal sign, with or without a header.

Data begin where a line, and the one below it, hold mostly numbers. What stands above is the header, and between both may
stand units. :mod:`pandas` parses the numbers; here the dialect is found.
"""

from __future__ import annotations

import gzip
import io
import re
import warnings
import zlib
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from identification.recordings.columns import read_label
from identification.recordings.dates import seconds_of_text
from identification.recordings.errors import NotARecordingError, RecordingError, broken
from identification.recordings.table import LARGEST, Series, Table

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    import pandas as pd

    from flexdrive_gym.recording import FloatArray

_NUMBER = re.compile(r"^[+-]?(\d+([.,]\d*)?|[.,]\d+)([ed][+-]?\d+)?$|^[+-]?(nan|inf(inity)?)$", re.IGNORECASE)
_DATE = re.compile(r"^\d{1,4}[-/.]\w{1,3}[-/.]\d{1,4}([ T]\d.*)?$|^\d{1,2}:\d{2}(:\d{2}([.,]\d+)?)?$|^\d{4}-\d\d-\d\dT")
_DECIMAL_COMMA = re.compile(r"^[+-]?\d*,\d+([ed][+-]?\d+)?$", re.IGNORECASE)
_BLANK = r"\s+"
_COMMENT = ("#", "%", "//", "'")
MOST_HEADER = 400  # lines above the data
_MOST_REMARKS = 12  # lines below the data
_MOST_ROWS = 5000  # lines that tell a decimal sign
_LIKE, _MOST_LIKE = 20, 0.7  # lines below the first one, and how many of them must be data, too
WIDEST = 4096  # columns


@dataclass(frozen=True)
class _Dialect:
    """How the lines of a file are to be cut, and where the data begin."""

    separator: str
    count: int
    first: int
    header: tuple[str, ...]
    named: bool
    comma: bool = False


def read_text(path: Path) -> Table:
    """Read a text file, compressed or not.

    Returns
    -------
    Table
        Without a header the columns have their numbers as names, counted from 1.

    Raises
    ------
    NotARecordingError
        If it holds no columns of numbers.
    RecordingError
        If it is damaged, too large or uneven.
    """
    source = path.name
    lines = _lines(_decoded(_bytes(path), source))
    dialect = _dialect(lines, source)
    body = _body(lines, dialect)
    if dialect.separator != ",":
        # the first line may hold whole numbers alone
        dialect = replace(dialect, comma="," in body and _decimal_commas(body, dialect))
    frame = _parse(body, dialect, source)
    labels = dialect.header
    values = tuple(_numbers(frame.iloc[:, k], labels[k], dialect, source) for k in range(dialect.count))
    kept = [k for k in range(dialect.count) if labels[k] or np.isfinite(values[k]).any()]
    series = tuple(
        Series(labels[k] or f"column {k + 1}", values[k], places=(str(k + 1),), named=dialect.named and bool(labels[k]))
        for k in kept
    )
    first = " ".join(lines[dialect.first].split())[:60]
    hint = "" if dialect.named else f"no header, the first line is '{first}'"
    return Table(series, hints=(hint,) if hint else ())


def _bytes(path: Path) -> bytes:
    try:
        if path.name.lower().endswith(".gz"):
            with gzip.open(path) as file:
                data = file.read(LARGEST + 1)
        else:
            with path.open("rb") as file:
                data = file.read(LARGEST + 1)
    except (OSError, EOFError, zlib.error) as error:
        if path.name.lower().endswith(".gz"):
            remedy = "Copy the file again, or compress it again with gzip."
            raise broken(path.name, "file", "must be complete gzip data", f"{error}", remedy) from error
        raise broken(path.name, "file", "must be readable", f"{error}", "Check its permissions.") from error
    if len(data) > LARGEST:
        rule = f"must be smaller than {LARGEST >> 20} MB"
        raise broken(path.name, "file", rule, "more", "Export fewer columns, or split the run.")
    return data


def _decoded(data: bytes, source: str) -> str:
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data.decode("utf-16", errors="replace")
    if b"\0" in data[:4096]:
        remedy = "It is binary: export the log as text with a header line such as t_s,u_V,v1_mm_s,v2_mm_s."
        raise NotARecordingError(str(broken(source, "file", "must be text", "bytes of value 0", remedy)))
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        # logging software of western Windows; every byte decodes, and numbers are ASCII anyway
        return data.decode("cp1252", errors="replace")


def _lines(text: str) -> list[str]:
    lines = text.replace("\0", "").splitlines()
    if any("[" in line for line in lines[:MOST_HEADER]):
        lines = _unbracketed(lines)
    return lines


def _unbracketed(lines: list[str]) -> list[str]:
    """Return the lines of a MATLAB matrix, ``[ 0 0.000 …; 1 …]``, without its brackets, one row a line."""
    start = next((k for k, line in enumerate(lines) if re.match(r"^\s*(\w+\s*=\s*)?\[\s*($|[-+.\d])", line)), None)
    if start is None:
        return lines
    block = "\n".join(lines[start:])
    opened = block.index("[")
    inside, _, _ = block[opened + 1 :].partition("]")
    rows = inside.replace("...\n", " ").replace(";", "\n")
    return lines[:start] + [row for row in rows.splitlines() if row.strip()]


def _dialect(lines: list[str], source: str) -> _Dialect:
    """Find where data begin, how they are separated and what the columns are called."""
    above: list[str] = []
    for place, line in enumerate(lines):
        bare = line.strip()
        if not bare:
            continue
        if not bare.startswith(_COMMENT):
            found = _cut(line)
            if found is not None and (_names_signals(above) or _begins(lines, place, found)):
                return _named(above, lines, place, *found)
            if len(above) >= MOST_HEADER:
                break
        above.append(line)
    if not above:
        raise broken(source, "file", "must hold a header and samples", "no lines", "Record the run again.")
    if all(line.strip().startswith(_COMMENT) for line in above):
        remedy = "Record the run again."
        raise NotARecordingError(str(broken(source, "file", "must hold a header and samples", "comments only", remedy)))
    if _names_signals(above):
        raise broken(source, "file", "must hold samples below the header", "none", "Record the run again.")
    error = broken(source, "file", "must hold columns of numbers", f"'{above[0].strip()[:60]}'", "Leave it out.")
    raise NotARecordingError(str(error))


def _separator_of(line: str) -> str:
    # a semicolon or tab outranks the comma, which may then be the decimal sign
    return next((mark for mark in (";", "\t", ",") if mark in line), _BLANK)


def _cells(line: str, separator: str) -> list[str]:
    if separator != "\t":
        line = line.strip()
    parts = re.split(separator, line) if separator == _BLANK else line.split(separator)
    return [cell.strip().strip("\"'").strip() for cell in parts]


def _cut(line: str) -> tuple[str, int, bool] | None:
    """Return separator, number of columns and whether the comma is the decimal sign, or ``None`` for a line without data."""
    if '"' in line and re.search(r'"[+-]?\d*,\d+"', line):
        cells = re.findall(r'"([^"]*)"', line)
        return (",", len(cells), True) if len(cells) > 1 else None
    marks = [mark for mark in (";", "\t", ",") if mark in line] + [_BLANK]
    if marks[0] == "," and _blank_with_decimal_comma(line):
        marks = [_BLANK]
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
        if not line.strip() or line.strip().startswith(_COMMENT):
            continue
        seen += 1
        other = _cut(line)
        same = other is not None and other[0] == found[0] and abs(other[1] - found[1]) <= 1
        like += same and _worded(line, found[0]) == _worded(lines[place], found[0])
    return seen > 0 and like >= _MOST_LIKE * seen


def _worded(line: str, separator: str) -> bool:
    """Whether a line begins with a word."""
    first = _cells(line, separator)[0]
    return bool(first) and not _NUMBER.match(first) and not _DATE.match(first)


def _named(above: list[str], lines: list[str], place: int, separator: str, count: int, comma: bool) -> _Dialect:
    """Return the dialect with the names of the columns, from the lines above the data."""
    candidates = [line.strip().lstrip("#%/' ") if line.strip().startswith(_COMMENT) else line for line in above]
    units: list[str] | None = None
    for line in reversed(candidates[-6:]):
        names = _header(line, separator, count)
        if names is None and separator == _BLANK:
            names = _header(line, separator, count - 1)
            names = names if names is not None and _numbered(lines[place:], separator) else None
        if names is None:
            continue
        if len(names) == count - 1 and _numbered(lines[place:], separator):
            names = ["", *names]
        if units is None and _are_units(names):
            units = names
            continue
        width = max(count, len(names))
        names += [""] * (width - len(names))
        if units is not None:
            names = [_with_unit(name, unit) for name, unit in zip(names, units + [""] * width, strict=False)]
        return _Dialect(separator, width, place, tuple(names), named=True, comma=comma)
    return _Dialect(separator, count, place, tuple(str(k + 1) for k in range(count)), named=False, comma=comma)


def _numbered(lines: list[str], separator: str) -> bool:
    """Whether rows begin with their number, and time comes second: such a first column often has no name."""
    rows = [_cells(line, separator)[:2] for line in lines[:_LIKE] if line.strip()]
    if len(rows) < 3 or not all(len(row) == 2 and row[0].isdigit() and _NUMBER.match(row[1]) for row in rows):
        return False
    number, time = [int(row[0]) for row in rows], [float(_point_and_e(row[1])) for row in rows]
    pairs = range(1, len(rows))
    return all(number[i] == number[i - 1] + 1 for i in pairs) and all(time[i] > time[i - 1] for i in pairs)


def _point_and_e(number: str) -> str:
    return re.sub("[dD]", "e", number.replace(",", "."))


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
    for mark in (separator, _separator_of(line), r"\s{2,}|\t", _BLANK):
        cells = re.split(mark, line.strip()) if mark.startswith("\\s") else _cells(line, mark)
        cells = [cell.strip().strip("\"'").strip() for cell in cells]
        while len(cells) > 1 and not cells[-1]:
            cells.pop()
        # a trailing separator under the header, or samples that end early
        fits = len(cells) == count or (mark == separator != _BLANK and count - 1 <= len(cells) <= count + 2)
        words = [cell for cell in cells if cell and not _NUMBER.match(cell)]
        if fits and len(cells) > 1 and 2 * len(words) > len([cell for cell in cells if cell]):
            return cells
    return None


def _body(lines: list[str], dialect: _Dialect) -> str:
    """Return the data lines, without comments, and without headers that a restarted log repeats."""
    body = lines[dialect.first :]
    marked = ("#", "%", "//")
    if any(mark in line for line in body for mark in marked):
        body = [line for line in body if not line.lstrip().startswith(marked)]
    first = next((name for name in dialect.header if name), "") if dialect.named else ""
    if first and any(first in line for line in body):
        body = [line for line in body if first not in line or _cut(line) is not None]
    # remarks below the data
    worded = _worded(body[0], dialect.separator)
    data = (k for k, line in enumerate(reversed(body[-_MOST_REMARKS:])) if _cut(line) is not None)
    end = next((k for k in data if worded or not _worded(body[-1 - k], dialect.separator)), 0)
    body = body[: len(body) - end]
    if dialect.separator == _BLANK and any(line[:1].isspace() for line in body):
        body = [line.strip() for line in body]
    return "\n".join(body)


def _parse(body: str, dialect: _Dialect, source: str) -> pd.DataFrame:
    import pandas as pd  # noqa: PLC0415  (costs more to import than the package needs for anything else)

    count = dialect.count
    surplus = "values beyond the last column"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", pd.errors.ParserWarning)
            warnings.simplefilter("ignore", pd.errors.DtypeWarning)
            frame = pd.read_csv(
                io.StringIO(body),
                sep=dialect.separator,
                header=None,
                names=list(range(count + 1)),  # one more, for separators that end each line
                index_col=False,
                skipinitialspace=True,
                decimal="," if dialect.comma else ".",
            )
    except (pd.errors.ParserError, pd.errors.ParserWarning, pd.errors.EmptyDataError, OverflowError) as error:
        raise _uneven(source, dialect, str(error).strip() or surplus) from error
    if frame[count].notna().any():
        raise _uneven(source, dialect, surplus)
    if frame.empty:
        raise broken(source, "file", "must hold samples below the header", "none", "Record the run again.")
    return frame.iloc[:, :count]


def _uneven(source: str, dialect: _Dialect, got: str) -> RecordingError:
    found = re.search(r"Expected \d+ fields in line (\d+), saw (\d+)", got)
    if found is not None:
        got = f"{found[2]} in line {dialect.first + int(found[1])}"
    remedy = "Remove or complete the lines that differ."
    if dialect.separator == ",":
        remedy += " If commas are decimal signs, too, export with semicolons between the values."
    rule = f"every line must have the {dialect.count} values of the header"
    return broken(source, "file", rule, " ".join(got.split())[:120], remedy)


def _thousands(cells: Iterable[str], mark: str) -> bool:
    """Whether a mark parts thousands: it does where only whole numbers from 1000 on have it, and three digits follow."""
    cells = list(cells)
    marked = [cell for cell in cells if mark in cell]
    whole = re.compile(rf"^[+-]?[1-9]\d{{0,2}}(\{mark}\d{{3}})+$")
    return (
        0 < len(marked) < len(cells)
        and all(whole.match(cell) for cell in marked)
        and all(re.match(r"^[+-]?\d{0,3}$", cell) for cell in cells if mark not in cell)
    )


def _decimal_commas(body: str, dialect: _Dialect) -> bool:
    """Whether commas are decimal signs: some are in a column where they part no thousands."""
    rows = [_cells(line, dialect.separator) for line in body.splitlines()[:_MOST_ROWS]]
    columns = ([row[k] for row in rows if k < len(row)] for k in range(dialect.count))
    return any("," in "".join(cells) and not _thousands(cells, ",") for cells in columns)


def _numbers(column: pd.Series, label: str, dialect: _Dialect, source: str) -> FloatArray:
    """Return a column as numbers, with empty cells, and words in unknown columns, as NaN."""
    import pandas as pd  # noqa: PLC0415

    if pd.api.types.is_numeric_dtype(column.dtype) or column.isna().all():
        return column.to_numpy(dtype=np.float64, na_value=np.nan)
    text = column.astype(str).str.strip()
    known = read_label(label) if dialect.named else None
    if known is None or known.signal == "t":
        seconds = seconds_of_text(column)
        if seconds is not None:
            return seconds
    if dialect.separator != ",":
        mark = "." if dialect.comma else ","
        text = text.str.replace(mark, "", regex=False) if _thousands(text.dropna(), mark) else text
        text = text.str.replace(",", ".", regex=False)
    numbers = pd.to_numeric(text.str.replace(r"(?<=\d)[dD](?=[+-]?\d+$)", "e", regex=True), errors="coerce")
    bad = numbers.isna() & column.notna() & ~text.str.lower().isin(["", "nan", "na", "-", "null", "none"])
    # remarks and states may stand in columns that nobody asks for
    if bad.any() and known is not None:
        row = int(np.argmax(bad.to_numpy()))
        raise broken(
            source,
            f"column {label}",
            "must hold numbers",
            f"'{text.iloc[row][:40]}' at sample {row + 1}",
            "Remove that line, such as a second header or a line of units, or write the value as a number.",
        )
    return numbers.to_numpy(dtype=np.float64, na_value=np.nan)

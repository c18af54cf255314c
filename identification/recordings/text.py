"""Text to columns of numbers: any separator, either decimal sign, with or without a header.

:mod:`.dialect` finds how lines are to be cut, and :mod:`pandas` parses the numbers.
"""

from __future__ import annotations

import gzip
import io
import re
import warnings
import zlib
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from identification.recordings.columns import read_label
from identification.recordings.dates import seconds_of_text
from identification.recordings.dialect import (
    BLANK,
    EXPONENT,
    MOST_HEADER,
    Dialect,
    cut,
    decimal_commas,
    dialect_of,
    parts_thousands,
    worded,
)
from identification.recordings.errors import NotARecordingError, RecordingError, broken
from identification.recordings.table import LARGEST, Series, Table

if TYPE_CHECKING:
    from pathlib import Path

    import pandas as pd

    from flexdrive_gym.recording import FloatArray

_MOST_REMARKS = 12  # lines below the data


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
    return read_lines(_lines(_decoded(_bytes(path), path.name)), path.name)


def read_lines(lines: list[str], source: str) -> Table:
    """Return the columns in lines of text; ``source`` names their file in errors."""
    dialect = dialect_of(lines, source)
    body = _body(lines, dialect)
    if dialect.separator != ",":
        # the first line may hold whole numbers alone
        dialect = replace(dialect, comma="," in body and decimal_commas(body.splitlines(), dialect))
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


def _body(lines: list[str], dialect: Dialect) -> str:
    """Return the data lines, without comments, and without headers that a restarted log repeats."""
    body = lines[dialect.first :]
    marked = ("#", "%", "//")
    if any(mark in line for line in body for mark in marked):
        body = [line for line in body if not line.lstrip().startswith(marked)]
    first = next((name for name in dialect.header if name), "") if dialect.named else ""
    if first and any(first in line for line in body):
        body = [line for line in body if first not in line or cut(line) is not None]
    # remarks below the data
    begins_worded = worded(body[0], dialect.separator)
    data = (k for k, line in enumerate(reversed(body[-_MOST_REMARKS:])) if cut(line) is not None)
    end = next((k for k in data if begins_worded or not worded(body[-1 - k], dialect.separator)), 0)
    body = body[: len(body) - end]
    if dialect.separator == BLANK and any(line[:1].isspace() for line in body):
        body = [line.strip() for line in body]
    return "\n".join(body)


def _parse(body: str, dialect: Dialect, source: str) -> pd.DataFrame:
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


def _uneven(source: str, dialect: Dialect, got: str) -> RecordingError:
    found = re.search(r"Expected \d+ fields in line (\d+), saw (\d+)", got)
    if found is not None:
        got = f"{found[2]} in line {dialect.first + int(found[1])}"
    remedy = "Remove or complete the lines that differ."
    if dialect.separator == ",":
        remedy += " If commas are decimal signs, too, export with semicolons between the values."
    rule = f"every line must have the {dialect.count} values of the header"
    return broken(source, "file", rule, " ".join(got.split())[:120], remedy)


def _numbers(column: pd.Series, label: str, dialect: Dialect, source: str) -> FloatArray:
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
        text = text.str.replace(mark, "", regex=False) if parts_thousands(text.dropna(), mark) else text
        text = text.str.replace(",", ".", regex=False)
    numbers = pd.to_numeric(text.str.replace(EXPONENT, "e", regex=True), errors="coerce")
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

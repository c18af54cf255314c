"""One file to named columns of numbers: ``.csv``, ``.csv.gz`` and ``.mat``.

What the columns mean is decided in :mod:`.columns`; here they are only found and turned into numbers.
"""

from __future__ import annotations

import difflib
import gzip
import io
import re
import warnings
import zlib
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from identification.recordings.columns import recognise_column
from identification.recordings.errors import RecordingError, broken

if TYPE_CHECKING:
    from pathlib import Path

    import pandas as pd

    from flexdrive_gym.recording import FloatArray

EXTENSIONS = (".csv", ".csv.gz", ".mat")

_NUMBER = re.compile(r"^[+-]?(\d+([.,]\d*)?|[.,]\d+)([ed][+-]?\d+)?$|^[+-]?(nan|inf(inity)?)$", re.IGNORECASE)


@dataclass(frozen=True)
class Table:
    """Named columns as they stand in a file.

    Attributes
    ----------
    labels
        Column names in file order, possibly repeated.
    values
        Their numbers, each ndarray, shape (n,).
    notes
        What was done to get them, for example that signals were joined on one time base.
    """

    labels: tuple[str, ...]
    values: tuple[FloatArray, ...]
    notes: tuple[str, ...] = ()


def extension(path: Path) -> str:
    """Return the lower-case extension, keeping ``.csv.gz`` together."""
    name = path.name.lower()
    return ".csv.gz" if name.endswith(".csv.gz") else path.suffix.lower()


def read_table(path: Path) -> Table:
    """Read one file.

    Parameters
    ----------
    path
        Existing file whose extension is one of :data:`EXTENSIONS`.

    Returns
    -------
    Table

    Raises
    ------
    RecordingError
        If the extension is unknown, the file is damaged, has no header, or holds something other than
        numbers.
    """
    kind = extension(path)
    if kind == ".mat":
        # scipy.io and h5py cost more time to import than a folder of CSV files takes to read
        from identification.recordings.matlab import read_matlab  # noqa: PLC0415

        labels, values, notes = read_matlab(path)
        return Table(labels, values, notes)
    if kind in EXTENSIONS:
        return _read_csv(path)
    near = difflib.get_close_matches(kind, EXTENSIONS, n=1, cutoff=0.6)
    hint = f"Did you mean {near[0]}? " if near else ""
    raise broken(
        path.name,
        "extension",
        f"must be one of {', '.join(EXTENSIONS)}",
        kind or "none",
        f"{hint}Export the log as .csv with a header line such as t_s,u_V,v1_mm_s,v2_mm_s.",
    )


def _text(path: Path) -> str:
    data = path.read_bytes()
    if extension(path) == ".csv.gz":
        try:
            data = gzip.decompress(data)
        except (OSError, EOFError, zlib.error) as error:
            raise broken(
                path.name,
                "file",
                "must be complete gzip data",
                f"{error}",
                "Copy the file again, or compress it again with gzip.",
            ) from error
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        # logging software of western Windows; every byte decodes, and numbers are ASCII anyway
        return data.decode("cp1252", errors="replace")


def _read_csv(path: Path) -> Table:
    header, separator, body = _split_header(_text(path), path.name)
    frame = _parse(body, separator, header, path.name)
    values = tuple(_numbers(frame.iloc[:, k], header[k], separator, path.name) for k in range(len(header)))
    named = [k for k, label in enumerate(header) if label or np.isfinite(values[k]).any()]
    return Table(
        tuple(header[k] or f"column {k + 1}" for k in named),
        tuple(values[k] for k in named),
    )


def _split_header(text: str, source: str) -> tuple[list[str], str, str]:
    """Return the column names, the separator and the lines below the header."""
    comment = ""
    position = 0
    while position < len(text):
        end = text.find("\n", position)
        end = len(text) if end < 0 else end
        line = text[position:end].strip()
        position = end + 1
        if line.startswith(("#", "%")):
            comment = line.lstrip("#% ")
        elif line:
            break
    else:
        raise broken(source, "file", "must hold a header and samples", "no lines", "Record the run again.")
    separator = _separator(line)
    if not _is_numeric(line, separator):
        return _cells(line, separator), separator, text[position:]
    # a header that numpy.savetxt or MATLAB commented out
    names = _cells(comment, _separator(comment))
    if len(names) == len(_cells(line, separator)) and not _is_numeric(comment, _separator(comment)):
        return names, separator, line + "\n" + text[position:]
    raise broken(
        source,
        "header",
        "the first line must name the columns",
        f"'{line[:60]}'",
        "Add a header line, for example t_s,u_V,v1_mm_s,v2_mm_s.",
    )


def _separator(line: str) -> str:
    # a semicolon or tab outranks the comma, which may then be the decimal sign
    return next((mark for mark in (";", "\t", ",") if mark in line), ",")


def _cells(line: str, separator: str) -> list[str]:
    return [cell.strip().strip("\"'").strip() for cell in line.split(separator)]


def _is_numeric(line: str, separator: str) -> bool:
    cells = [cell for cell in _cells(line, separator) if cell]
    return bool(cells) and all(_NUMBER.match(cell) for cell in cells)


def _parse(body: str, separator: str, header: list[str], source: str) -> pd.DataFrame:
    import pandas as pd  # noqa: PLC0415  (costs more to import than the package needs for anything else)

    if "\n#" in body or "\n%" in body or body.startswith(("#", "%")):
        lines = body.splitlines()
        body = "\n".join(line for line in lines if not line.lstrip().startswith(("#", "%")))
    count = len(header)
    surplus = "values beyond the last column"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", pd.errors.ParserWarning)
            frame = pd.read_csv(
                io.StringIO(body),
                sep=separator,
                header=None,
                names=list(range(count + 1)),  # one more, for separators that end each line
                index_col=False,
                skipinitialspace=True,
            )
    except (pd.errors.ParserError, pd.errors.ParserWarning) as error:
        raise _uneven(source, count, str(error).strip() or surplus) from error
    if frame[count].notna().any():
        raise _uneven(source, count, surplus)
    if frame.empty:
        raise broken(source, "file", "must hold samples below the header", "none", "Record the run again.")
    return frame.iloc[:, :count]


def _uneven(source: str, count: int, got: str) -> RecordingError:
    return broken(
        source,
        "file",
        f"every line must have the {count} values of the header",
        got,
        "Remove or complete the lines that differ.",
    )


def _numbers(column: pd.Series, label: str, separator: str, source: str) -> FloatArray:
    """Return a column as numbers, with empty cells, and words in unknown columns, as NaN."""
    import pandas as pd  # noqa: PLC0415

    if pd.api.types.is_numeric_dtype(column.dtype) or column.isna().all():
        return column.to_numpy(dtype=np.float64, na_value=np.nan)
    text = column.astype(str).str.strip()
    if separator != ",":
        text = text.str.replace(",", ".", regex=False)
    numbers = pd.to_numeric(text, errors="coerce")
    bad = numbers.isna() & column.notna() & ~text.str.lower().isin(["", "nan", "na"])
    # remarks and states may stand in columns that nobody asks for
    if bad.any() and recognise_column(label, source) is not None:
        row = int(np.argmax(bad.to_numpy()))
        raise broken(
            source,
            f"column {label}",
            "must hold numbers",
            f"'{text.iloc[row]}' at sample {row + 1}",
            "Remove that line, such as a second header or a line of units, or write the value as a number.",
        )
    return numbers.to_numpy(dtype=np.float64, na_value=np.nan)

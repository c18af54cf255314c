"""One file to named columns of numbers, whatever its format.

What the columns mean is decided in :mod:`.roles`; here they are only found and turned into numbers.
"""

from __future__ import annotations

import difflib
import importlib.util
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from identification.recordings.dates import date_of_name
from identification.recordings.errors import broken, damaged
from identification.recordings.table import Series, Table, require_size

if TYPE_CHECKING:
    from pathlib import Path

    from flexdrive_gym.recording import FloatArray

_TEXT = (".csv", ".txt", ".dat", ".tsv", ".log", ".asc", ".lvm")
_HDF5 = (".h5", ".hdf5")
_OTHERS = (".mat", ".parquet", ".xlsx", ".npz", *_HDF5)
EXTENSIONS = (*_TEXT, *(f"{kind}.gz" for kind in _TEXT), *_OTHERS)
NOT_READ = (".xls", ".ods", ".tdms", ".npy", ".mf4", ".mdf", ".xz", ".bz2")
"""May hold recordings but are not read: listed with that reason, where other kinds of files are not even listed."""

LARGEST_NUMBER = 1e60

__all__ = ["EXTENSIONS", "NOT_READ", "Series", "Table", "extension", "read_tables"]


def extension(path: Path) -> str:
    """Return the lower-case extension, keeping ``.csv.gz`` together."""
    name = path.name.lower()
    return next((kind for kind in EXTENSIONS if kind.endswith(".gz") and name.endswith(kind)), path.suffix.lower())


def read_tables(path: Path) -> list[Table]:
    """Read one file, which holds one table, or several: a spreadsheet may have sheets.

    Parameters
    ----------
    path
        Existing file whose extension is one of :data:`EXTENSIONS`.

    Returns
    -------
    list of Table
        At least one.

    Raises
    ------
    RecordingError
        If the extension is unknown, the file is damaged, or holds something other than numbers.
    """
    return [
        replace(
            table,
            series=tuple(replace(item, values=_sane(item.values)) for item in table.series),
            recorded=table.recorded or date_of_name(path.name),
        )
        for table in _tables(path)
    ]


def _tables(path: Path) -> list[Table]:
    kind = extension(path)
    if kind in (".mat", *_HDF5):
        # scipy.io and h5py cost more time to import than a folder of text files takes to read
        from identification.recordings.matlab import read_matlab  # noqa: PLC0415

        return [read_matlab(path)]
    if kind == ".npz":
        from identification.recordings.numpy_file import read_npz  # noqa: PLC0415

        return [read_npz(path)]
    if kind == ".parquet":
        return [_read_parquet(path)]
    if kind == ".xlsx":
        from identification.recordings.spreadsheet import read_spreadsheet  # noqa: PLC0415

        return read_spreadsheet(path)
    if kind in EXTENSIONS:
        from identification.recordings.text import read_text  # noqa: PLC0415  (imports pandas)

        return [read_text(path)]
    near = difflib.get_close_matches(kind, EXTENSIONS, n=1, cutoff=0.6)
    hint = f"Did you mean {near[0]}? " if near else ""
    raise broken(
        path.name,
        "extension",
        f"must be one of {', '.join((*_TEXT, *_OTHERS))}",
        kind or "none",
        f"{hint}Export the log as .csv with a header line such as t_s,u_V,v1_mm_s,v2_mm_s.",
    )


def _sane(values: FloatArray) -> FloatArray:
    """Return numbers without those that no sensor gives, which damaged files hold: they are missing, or nothing."""
    size = np.abs(values)
    odd = ~np.isfinite(values) | (size > LARGEST_NUMBER) | ((size < 1.0 / LARGEST_NUMBER) & (size > 0.0))
    return np.where(odd, np.where(size < 1.0, 0.0, np.nan), values) if odd.any() else values


def _read_parquet(path: Path) -> Table:
    if not any(importlib.util.find_spec(name) for name in ("pyarrow", "fastparquet")):
        remedy = "Run 'pip install pyarrow', or export the log as .csv."
        raise broken(path.name, "file", "needs the package pyarrow or fastparquet", "neither", remedy)
    import pandas as pd  # noqa: PLC0415

    try:
        frame = pd.read_parquet(path).reset_index()
    # each of the two libraries has its own errors for damaged files
    except Exception as error:
        raise damaged(path.name, "parquet", error, "Export the log as .csv.") from error
    require_size(path.name, 8 * frame.size, "Export fewer columns, or split the run.")
    series: list[Series] = []
    for label in frame.columns:
        column = frame[label]
        if pd.api.types.is_datetime64_any_dtype(column.dtype):
            numbers = (column - pd.Timestamp(0, tz=column.dt.tz)).dt.total_seconds()
        elif pd.api.types.is_timedelta64_dtype(column.dtype):
            numbers = column.dt.total_seconds()
        else:
            numbers = pd.to_numeric(column, errors="coerce")
        values = np.asarray(numbers, dtype=np.float64)
        if label != "index":
            series.append(Series(str(label), values, places=(str(len(series) + 1),)))
    return Table(tuple(series))

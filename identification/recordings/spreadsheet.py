"""Spreadsheets to columns: their cells are lines of text, with titles, names and units above the numbers as there."""

from __future__ import annotations

import importlib.util
from dataclasses import replace
from datetime import date, datetime, time
from typing import TYPE_CHECKING, Any
from zipfile import BadZipFile

from identification.recordings.errors import NotARecordingError, RecordingError, broken, damaged
from identification.recordings.table import require_unpacked_size
from identification.recordings.text import read_lines

if TYPE_CHECKING:
    from pathlib import Path

    from identification.recordings.table import Table

_REMEDY = "Export the log as .csv."


def read_spreadsheet(path: Path) -> Table:
    """Read the first sheet of an ``.xlsx`` file that holds columns of numbers.

    Raises
    ------
    NotARecordingError
        If no sheet does.
    RecordingError
        If the file is damaged or too large, or the package that reads it is not installed.
    """
    if importlib.util.find_spec("openpyxl") is None:
        remedy = "Run 'pip install openpyxl', or export the log as .csv."
        raise broken(path.name, "file", "needs the package openpyxl", "none", remedy)
    found: list[tuple[str, Table]] = []
    errors: list[RecordingError] = []
    for name, lines in _sheets(path).items():
        try:
            found.append((name, read_lines(lines, path.name)))
        except RecordingError as error:
            errors.append(error)
    if not found:
        raise errors[0] if errors else NotARecordingError(f"{path.name}: no sheets")
    (name, table), *others = found
    if not others:
        return table
    rest = ", ".join(other for other, _ in others[:3])
    note = f"warning: of {len(found)} sheets with numbers '{name}' is read. Save {rest} as files of their own"
    return replace(table, notes=(*table.notes, note))


def _sheets(path: Path) -> dict[str, list[str]]:
    """Return the lines of every sheet, cells parted by tabs."""
    import openpyxl  # noqa: PLC0415  (costs more to import than most files to read)

    try:
        require_unpacked_size(path, _REMEDY)
        book = openpyxl.load_workbook(path, read_only=True, data_only=True)
        try:
            return {
                sheet.title: ["\t".join(map(_text, row)) for row in sheet.iter_rows(values_only=True)]
                for sheet in book.worksheets
            }
        finally:
            book.close()
    except RecordingError:
        raise
    except (OSError, ValueError, KeyError, TypeError, AttributeError, SyntaxError, BadZipFile) as error:
        raise damaged(path.name, ".xlsx", error, _REMEDY) from error


def _text(cell: Any) -> str:
    if cell is None:
        return ""
    if isinstance(cell, bool):
        return str(int(cell))
    if isinstance(cell, float):
        return f"{cell:.17g}"
    if isinstance(cell, datetime | date | time):
        return cell.isoformat()
    return " ".join(str(cell).split())

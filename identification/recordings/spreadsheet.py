"""Spreadsheets to columns: their cells are lines of text, with titles, names and units above the numbers as there."""

from __future__ import annotations

import importlib.util
from dataclasses import replace
from datetime import date, datetime, time
from typing import TYPE_CHECKING, Any
from zipfile import BadZipFile

from identification.recordings.errors import NotARecordingError, RecordingError, broken, damaged, left_out
from identification.recordings.table import require_unpacked_size
from identification.recordings.text import read_lines

if TYPE_CHECKING:
    from pathlib import Path

    from identification.recordings.table import Table

_REMEDY = "Export the log as .csv."


def read_spreadsheet(path: Path) -> list[Table]:
    """Read the sheets of an ``.xlsx`` file that hold columns of numbers, each with its title if there are several.

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
    found: list[Table] = []
    errors: dict[str, RecordingError] = {}
    for title, lines in _sheets(path).items():
        try:
            found.append(replace(read_lines(lines, path.name), part=title))
        except RecordingError as error:
            errors[title] = error
    if not found:
        raise next(iter(errors.values()), NotARecordingError(f"{path.name}: no sheets"))
    # sheets of words are none, sheets of numbers with an error may be
    notes = [left_out(path.name, n, e) for n, e in errors.items() if not isinstance(e, NotARecordingError)]
    several = len(found) > 1
    return [replace(table, notes=(*table.notes, *notes), part=table.part if several else "") for table in found]


def _sheets(path: Path) -> dict[str, list[str]]:
    """Return the lines of every sheet, cells parted by tabs."""
    import openpyxl  # noqa: PLC0415  (costs more to import than most files to read)

    try:
        require_unpacked_size(path, _REMEDY)
        book = openpyxl.load_workbook(path, read_only=True, data_only=True)
        try:
            lines = {
                sheet.title: ["\t".join(map(_text, row)) for row in sheet.iter_rows(values_only=True)]
                for sheet in book.worksheets
            }
            return {title: own for title, own in lines.items() if any(line.strip() for line in own)}
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

"""What a file holds before anything is understood: columns of numbers, each with a name, a place and perhaps a clock."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING
from zipfile import ZipFile

from identification.recordings.errors import broken

if TYPE_CHECKING:
    from datetime import datetime
    from pathlib import Path

    from flexdrive_gym.recording import FloatArray

LARGEST = 1 << 30
"""Bytes of numbers in one file that are read: a damaged header may declare any size."""


def require_size(source: str, size: int, remedy: str) -> None:
    """Refuse a file of more bytes of numbers than are read."""
    if size > LARGEST:
        raise broken(source, "file", f"must be smaller than {LARGEST >> 20} MB", f"{size >> 20} MB", remedy)


def require_unpacked_size(path: Path, remedy: str) -> None:
    """Refuse an archive that would unpack to more than is read."""
    with ZipFile(path) as parts:
        require_size(path.name, sum(part.file_size for part in parts.infolist()), remedy)


@dataclass(frozen=True)
class Series:
    """One column.

    Attributes
    ----------
    label
        Its name, or a number where the file gives none.
    values
        ndarray, shape (n,).
    clock
        Its own time [s], ndarray, shape (n,), where the file says so.
    group
        Struct it stands in, empty for the workspace and for text.
    places
        Other ways to name it, such as ``data:3``.
    named
        Whether the file names it, so that it may be recognised.
    """

    label: str
    values: FloatArray
    clock: FloatArray | None = None
    group: str = ""
    places: tuple[str, ...] = ()
    named: bool = True

    @property
    def shown(self) -> str:
        """The name that tells it apart from others."""
        return self.places[0] if self.places and (self.group or not self.named) else self.label


@dataclass(frozen=True)
class Table:
    """Columns as they stand in a file.

    Attributes
    ----------
    series
        Columns in file order, names possibly repeated.
    notes
        What was done to get them.
    hints
        What shows that a file without a header has none.
    remarks
        What helps where a signal is missing, such as matrices whose columns have no names; sentences.
    recorded
        When the file says it was recorded.
    in_lines
        Whether what stands in one line belongs to one instant, as in text; vectors of a workspace may be of several loggers.
    part
        Title of the sheet, where a file holds several tables; else empty.
    """

    series: tuple[Series, ...]
    notes: tuple[str, ...] = ()
    hints: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    recorded: datetime | None = None
    in_lines: bool = True
    part: str = ""

    @property
    def labels(self) -> tuple[str, ...]:
        """Names in file order."""
        return tuple(item.label for item in self.series)

    @property
    def values(self) -> tuple[FloatArray, ...]:
        """Numbers in file order, each ndarray, shape (n,)."""
        return tuple(item.values for item in self.series)

"""What is known of one file while its columns get their roles: which may play which, and what was found out on the way."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from identification.recordings.errors import broken
from identification.recordings.rig import SIGNAL

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flexdrive_gym.recording import FloatArray
    from identification.recordings.columns import Column
    from identification.recordings.errors import RecordingError
    from identification.recordings.rig import Rig
    from identification.recordings.table import Series, Table

ROLE = {signal: role for role, signal in SIGNAL.items()}
MOST_LISTED = 12


@dataclass(frozen=True)
class Roles:
    """The signals of one file.

    Attributes
    ----------
    signals
        In the rig's units, ``t`` among them, each ndarray, shape (n,).
    factors
        By signal, from the file's units to the rig's.
    filtered
        Velocities that were filtered.
    unit
        Of the time column, as its name says.
    notes
        What was chosen, done and left out.
    """

    signals: dict[str, FloatArray]
    factors: dict[str, float]
    filtered: tuple[str, ...] = ()
    unit: str = ""
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Candidate:
    """A column that may play a role: its values, the factor to the rig's unit, and its name where that told the role."""

    series: Series
    factor: float
    column: Column | None = None

    @property
    def rank(self) -> int:
        """Return how far it stands behind what the description names."""
        return 0 if self.column is None else self.column.rank

    @property
    def words(self) -> frozenset[str]:
        """Return what its name says besides the signal."""
        return frozenset() if self.column is None else frozenset(self.column.words)


@dataclass
class File:
    """What is known of one file while its roles are found."""

    table: Table
    rig: Rig
    source: str
    candidates: dict[str, list[Candidate]] = field(default_factory=dict)
    absent: dict[str, tuple[str, ...]] = field(default_factory=dict)
    strange: dict[str, Column] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def error(self, what: str, rule: str, got: str, remedy: str) -> RecordingError:
        """Return an error that names the file."""
        return broken(self.source, what, rule, got, remedy)

    def shown(self) -> str:
        """Return the columns that can be named, for messages."""
        names = list(dict.fromkeys(series.shown for series in self.table.series))
        more = f" and {len(names) - MOST_LISTED} more" if len(names) > MOST_LISTED else ""
        return f"columns {', '.join(names[:MOST_LISTED])}{more}" if names else "no columns"


def either(names: Sequence[str]) -> str:
    """Return names as a sentence has them."""
    return " or ".join(f"'{name}'" for name in names)

"""What reading a folder gives: its recordings, and the files that were left out, each with its reason."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Self

from flexdrive_gym.recording import Recording
from flexdrive_gym.units import LAB, Units
from identification.recordings.rig import Rig


@dataclass(frozen=True)
class Skipped:
    """A file that was left out.

    Attributes
    ----------
    file
        Path from the folder down.
    reason
        One sentence: what, which rule, the value, a remedy.
    """

    file: str
    reason: str


class RecordingSet(tuple[Recording, ...]):  # noqa: SLOT001  (it has attributes, which a tuple's slots cannot hold)
    """Recordings of one rig, which are a tuple, and what was left out.

    Attributes
    ----------
    skipped : tuple of Skipped
        Files that were left out.
    rig : Rig
        Description they were read with.
    """

    skipped: tuple[Skipped, ...]
    rig: Rig

    def __new__(
        cls, recordings: Iterable[Recording] = (), skipped: Iterable[Skipped] = (), rig: Rig | None = None
    ) -> Self:
        """Return the set; ``rig`` defaults to one that says nothing."""
        made = super().__new__(cls, tuple(recordings))
        made.skipped = tuple(skipped)
        made.rig = Rig() if rig is None else rig
        return made

    def __reduce__(self) -> tuple[Any, ...]:
        return RecordingSet, (tuple(self), self.skipped, self.rig)

    @property
    def units(self) -> Units:
        """The rig's units."""
        return self[0].units if self else LAB

    def summary(self) -> str:
        """Return one sentence: how many were read, how many left out."""
        left = f"; {len(self.skipped)} files left out" if self.skipped else ""
        return f"{len(self)} recordings read{left}"

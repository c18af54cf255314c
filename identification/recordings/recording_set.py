"""What reading a folder gives: its recordings, and the files that were left out, each with its reason."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Self

from flexdrive_gym.recording import Recording
from flexdrive_gym.units import LAB, Units
from identification.recordings.rig import Rig

# how a note begins that a reader should not miss
ALARM = "warning: "


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
    idle : tuple of str
        Patterns of its rules for some files that hold for none.
    """

    skipped: tuple[Skipped, ...]
    rig: Rig
    idle: tuple[str, ...]

    def __new__(
        cls,
        recordings: Iterable[Recording] = (),
        skipped: Iterable[Skipped] = (),
        rig: Rig | None = None,
        idle: Iterable[str] = (),
    ) -> Self:
        """Return the set; ``rig`` defaults to one that says nothing."""
        made = super().__new__(cls, tuple(recordings))
        made.skipped = tuple(skipped)
        made.rig = Rig() if rig is None else rig
        made.idle = tuple(idle)
        return made

    def __reduce__(self) -> tuple[Any, ...]:
        return RecordingSet, (tuple(self), self.skipped, self.rig, self.idle)

    @property
    def units(self) -> Units:
        """The rig's units."""
        return self[0].units if self else LAB

    def summary(self) -> str:
        """Return one sentence: how many were read, how many left out, which rules for some files fit none."""
        left = f"; {_count(len(self.skipped), 'file')} left out" if self.skipped else ""
        idle = f"; no file falls under the rule {listed([repr(p) for p in self.idle])} of rig.toml" if self.idle else ""
        return f"{_count(len(self), 'recording')} read{left}{idle}"


def reasons(skipped: Iterable[Skipped], most: int | None = None, rest: str = "") -> list[str]:
    """Return one line for each reason to leave files out: the first file, how many more, the reason.

    Parameters
    ----------
    most
        Lines at most; one more then counts the other files.
    rest
        What that line ends with.
    """
    files: dict[str, list[str]] = {}
    for item in skipped:
        files.setdefault(item.reason, []).append(item.file)
    lines = [
        f"{own[0]}{f' and {len(own) - 1} more' if len(own) > 1 else ''}: {reason}" for reason, own in files.items()
    ]
    if most is None or len(lines) <= most:
        return lines
    return [*lines[:most], f"and {_count(sum(len(own) for own in list(files.values())[most:]), 'more file')}{rest}"]


def notes_of(recordings: Iterable[Recording]) -> tuple[list[str], list[str]]:
    """Return the reader's warnings and its notes, each once, with the recordings that it is about."""
    names: dict[str, list[str]] = {}
    for recording in recordings:
        for note in recording.notes:
            names.setdefault(note, []).append(recording.name)
    said = [f"{note} ({listed(own)})" for note, own in names.items()]
    alarms = [text.removeprefix(ALARM) for text in said if text.startswith(ALARM)]
    return alarms, [text for text in said if not text.startswith(ALARM)]


def listed(names: Sequence[str]) -> str:
    """Return the first three names, and how many more there are."""
    return ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")


def _count(n: int, what: str) -> str:
    return f"{n} {what}{'' if n == 1 else 's'}"

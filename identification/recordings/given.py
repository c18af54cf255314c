"""What a function of this package may be given: a folder, files, or recordings already read."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from flexdrive_gym.recording import Recording
from identification.recordings.reader import read_recordings
from identification.recordings.recording_set import RecordingSet
from identification.recordings.rig import Rig

Source = str | Path | Sequence[str | Path] | Sequence[Recording]


def given(source: Source, rig: Rig | str | Path | None = None) -> RecordingSet:
    """Return recordings already read as they are, and read all else with the rig description.

    Raises
    ------
    RecordingError
        As :func:`~identification.recordings.reader.read_recordings`.
    """
    if isinstance(source, RecordingSet):
        return source
    if isinstance(source, str | Path):
        return read_recordings(source, rig=rig)
    items = list(source)
    runs = [item for item in items if isinstance(item, Recording)]
    if items and len(runs) == len(items):
        return RecordingSet(runs)
    return read_recordings([item for item in items if not isinstance(item, Recording)], rig=rig)

"""How every command reads recordings: a rig description, patterns, and what was left out."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from flexdrive_gym import Recording
    from flexdrive_gym.units import Units
    from identification.recordings import RecordingSet

_SHOWN = 12

RigFile = Annotated[
    Path | None,
    typer.Option("--rig", exists=True, dir_okay=False, help="rig.toml: what the columns mean (docs/recordings.md)."),
]
Strict = Annotated[bool, typer.Option("--strict", help="A file that cannot be read is an error.")]
Only = Annotated[list[str] | None, typer.Option("--only", metavar="GLOB", help="Read only such files; repeatable.")]
Skip = Annotated[list[str] | None, typer.Option("--skip", metavar="GLOB", help="Leave such files out; repeatable.")]


def read(
    recordings: Sequence[Path],
    rig: Path | None,
    strict: bool,
    only: Sequence[str] | None,
    skip: Sequence[str] | None,
    units: Units | None = None,
) -> RecordingSet:
    """Read the recordings that a command was given; ``units`` are those of a drive they are compared with."""
    from identification import read_recordings  # noqa: PLC0415

    scale: dict[str, Any] = {} if units is None or units.lab else {"units": units}
    return read_recordings(recordings, rig=rig, strict=strict, only=only or (), skip=skip or (), **scale)


def skipped_lines(found: RecordingSet) -> list[str]:
    """Return what to say of files that were left out and rules that fit none; nothing where there are no such."""
    if not found.skipped:
        return [found.summary()] if found.idle else []
    from identification.recordings.recording_set import reasons  # noqa: PLC0415

    lines = reasons(found.skipped, _SHOWN, "; 'flexdrive check' lists all")
    return [f"{found.summary()}:", *(f"  {line}" for line in lines)]


def skipped_json(found: Sequence[Recording]) -> list[dict[str, Any]]:
    """Return the files that were left out as JSON knows them; none where recordings were not read from files."""
    return [{"file": item.file, "reason": item.reason} for item in getattr(found, "skipped", ())]

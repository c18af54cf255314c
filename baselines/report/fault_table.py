"""Data faults as a table and in captions, the same on every page."""

from __future__ import annotations

from collections.abc import Iterable

from baselines.report.page import Section
from flexdrive_gym import Fault, Recording


def add_faults(section: Section, faults: Iterable[Fault]) -> None:
    """Add a table of faults, gathered already."""
    section.table(
        ("recording", "channel", "fault", "from [s]", "to [s]", "note"),
        [
            (
                f.recording,
                f.where.replace("_", " "),
                f.id.replace("_", " "),
                f"{f.start_s:.3f}",
                f"{f.end_s:.3f}",
                f.note,
            )
            for f in faults
        ],
    )


def shaded(recording: Recording) -> str:
    """Return what a figure's caption adds where the recording has faults."""
    kinds = {fault.id == "saturation" for fault in recording.faults}
    texts = (
        " Shaded: data faults." if False in kinds else "",
        " Shaded green: the command at its limit." if True in kinds else "",
    )
    return "".join(texts)

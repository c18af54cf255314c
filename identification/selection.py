"""Which recordings a fit can use, said in one place for identification, diagnosis and check.

The base model has two carts that move freely, starts at rest with its spring relaxed and is driven by its command. A run that is
otherwise is left out, with a sentence: a copy, a held cart, a command that is none, a run without command.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from flexdrive_gym.recording import Recording
from identification.experiment import Reference, as_reference, held_carts, silent
from identification.recordings.recording_set import RecordingSet, listed

Why = Literal["duplicate", "held", "reference", "silent"]
_WORDS: dict[Why, tuple[str, str]] = {
    "duplicate": ("duplicate", ""),
    "held": ("with a held cart", ": the model has two carts that move"),
    "reference": ("with a reference for a command", ": what drove the cart was not recorded"),
    "silent": ("without command", ": the model starts at rest"),
}


@dataclass(frozen=True, eq=False)
class Selection:
    """Recordings of a rig, told apart by what a fit can do with them.

    Attributes
    ----------
    usable
        Runs of the drive, in open and closed loop.
    left_out
        The others, each with the reason.
    held
        Name of a recording to its held carts.
    references
        Name of a recording to why its command is a reference.
    """

    usable: RecordingSet
    left_out: tuple[tuple[Recording, Why], ...]
    held: dict[str, tuple[int, ...]]
    references: dict[str, Reference]

    @property
    def reasons(self) -> dict[str, Why]:
        """Name of a recording that is left out to the reason."""
        return {r.name: why for r, why in self.left_out}

    @property
    def notes(self) -> list[str]:
        """One sentence for each reason."""
        found = []
        for why, (what, because) in _WORDS.items():
            names = [r.name for r, reason in self.left_out if reason == why]
            if names:
                runs = "recording" if len(names) == 1 else "recordings"
                counted = f"{len(names)} {what} {runs}" if why == "duplicate" else f"{len(names)} {runs} {what}"
                found.append(f"{counted} left out{because} ({listed(names)})")
        return found

    def require(self) -> RecordingSet:
        """Return the usable recordings.

        Raises
        ------
        ValueError
            If there are none; with every reason.
        """
        if not self.usable:
            reasons = "; ".join(self.notes) or "none"
            raise ValueError(
                f"recordings: needs at least one run of the drive; got {reasons}. Record squares and sines (handout 2.5, 2.6)."
            )
        return self.usable


def select(recordings: Sequence[Recording]) -> Selection:
    """Tell the recordings that a fit can use from those it cannot."""
    held = {r.name: carts for r, carts in zip(recordings, held_carts(recordings), strict=True) if carts}
    references: dict[str, Reference] = {}
    usable, out = [], []
    for r in recordings:
        why = _why(r, recordings, held, references)
        if why is None:
            usable.append(r)
        else:
            out.append((r, why))
    if isinstance(recordings, RecordingSet):
        return Selection(RecordingSet(usable, recordings.skipped, recordings.rig), tuple(out), held, references)
    return Selection(RecordingSet(usable), tuple(out), held, references)


def _why(
    r: Recording, recordings: Sequence[Recording], held: dict[str, tuple[int, ...]], references: dict[str, Reference]
) -> Why | None:
    if any(f.id == "duplicate_recording" for f in r.faults):
        return "duplicate"
    if r.name in held:
        return "held"
    if silent(r):
        return "silent"
    reference = as_reference(r, factors(r, recordings))
    if reference is not None:
        references[r.name] = reference
        return "reference"
    return None


def factors(recording: Recording, recordings: Sequence[Recording]) -> dict[str, float]:
    """Return how one file unit of each role reads in the rig's unit, as the description says for that file."""
    if not isinstance(recordings, RecordingSet):
        return {}
    units = recordings.rig.for_file(recording.source).units
    return {role: unit.factor for role, unit in units.items() if unit.factor is not None}

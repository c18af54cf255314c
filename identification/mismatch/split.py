"""Which recordings a diagnosis learns from, and which it keeps to prove itself on.

Kept away are the closed-loop runs, sines between others in frequency, one amplitude of square wave (with all its
replicates) that lies between others if there are three, and further replicates: conditions that the fit has not seen, but
that it must answer for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from flexdrive_gym.recording import Recording

_FEWEST = 4


@dataclass(frozen=True, eq=False)
class Split:
    """Recordings to learn from and to prove on.

    Attributes
    ----------
    learn
        Open-loop recordings the search may see; the closed-loop ones if there is nothing else.
    prove
        Open-loop recordings kept away.
    loops
        Closed-loop recordings kept away.
    """

    learn: tuple[Recording, ...]
    prove: tuple[Recording, ...]
    loops: tuple[Recording, ...]


def split_recordings(recordings: Sequence[Recording]) -> Split:
    """Divide the recordings of one drive.

    Raises
    ------
    ValueError
        If there is nothing to learn from.
    """
    good = [r for r in recordings if not any(f.id == "duplicate_recording" for f in r.faults)]
    loops = [r for r in good if r.closed_loop]
    free = [r for r in good if not r.closed_loop]
    if not free:
        if not loops:
            raise ValueError(
                "recordings: needs at least one run of the drive; got none. Record squares and sines (handout 2.5, 2.6)."
            )
        return Split(tuple(loops), (), ())
    kept: set[str] = set()
    if len(free) >= _FEWEST:
        kept |= _sines([r for r in free if r.excitation.kind == "sine"])
        kept |= _squares([r for r in free if r.excitation.kind == "square"])
    return Split(tuple(r for r in free if r.name not in kept), tuple(r for r in free if r.name in kept), tuple(loops))


def _sines(sines: Sequence[Recording]) -> set[str]:
    """Every fourth frequency, beginning with the third: never the lowest or the highest."""
    frequencies = sorted({round(r.excitation.frequency, 3) for r in sines})
    chosen = set(frequencies[2:-1:4])
    return {r.name for r in sines if round(r.excitation.frequency, 3) in chosen}


def _squares(squares: Sequence[Recording]) -> set[str]:
    amplitudes = sorted({round(r.excitation.amplitude, 2) for r in squares})
    if len(amplitudes) < 2:
        return set()
    chosen = amplitudes[1] if len(amplitudes) > 2 else amplitudes[-1]
    return {r.name for r in squares if round(r.excitation.amplitude, 2) == chosen}

"""Which recordings a diagnosis learns from, and which it keeps to prove itself on.

Kept away are the closed-loop runs, sines between others in frequency, one amplitude of square wave (with all its
replicates) that lies between others if there are three, and further replicates: conditions that the fit has not seen, but
that it must answer for. Where the recordings have no such order (only closed-loop runs, or commands of other kinds), every
fourth is kept away, beginning with the third.

What differs between recordings tells physics from chance, so a single long recording is cut into parts. Each part starts where
the whole was at that instant.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from flexdrive_gym.recording import Recording

_FEWEST = 4
# parts of a single recording [s], and how many at most
_PART_S, _MOST_PARTS = 1.5, 12


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
    parts
        Whether all are parts of one recording.
    """

    learn: tuple[Recording, ...]
    prove: tuple[Recording, ...]
    loops: tuple[Recording, ...]
    parts: bool = False


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
        runs = cut(loops[0]) if len(loops) == 1 else tuple(loops)
        names = _every_fourth(runs) if len(runs) >= _FEWEST else set()
        prove = tuple(r for r in runs if r.name in names)
        return Split(tuple(r for r in runs if r.name not in names), prove, (), len(runs) > len(loops))
    parts = len(free) == 1 and free[0].excitation.kind == "other"
    if parts:
        free = list(cut(free[0]))
    kept: set[str] = set()
    if len(free) >= _FEWEST:
        kept |= _sines([r for r in free if r.excitation.kind == "sine"])
        kept |= _squares([r for r in free if r.excitation.kind == "square"])
        kept = kept or _every_fourth([r for r in free if r.excitation.kind == "other"])
    prove = tuple(r for r in free if r.name in kept)
    return Split(tuple(r for r in free if r.name not in kept), prove, tuple(loops), parts)


def cut(recording: Recording, part_s: float = _PART_S) -> tuple[Recording, ...]:
    """Return the parts of a recording, which keep its clock and, from their summed velocities if need be, its positions.

    Returns
    -------
    tuple of Recording
        At most twelve; the recording itself where two parts would be shorter than ``part_s`` [s].
    """
    h = recording.sample_time
    parts = min(int(recording.n * h / part_s), _MOST_PARTS)
    if parts < 2:
        return (recording,)
    placed = {}
    for x, v in (("x1", "v1"), ("x2", "v2")):
        speed = getattr(recording, v)
        if getattr(recording, x) is None and speed is not None:
            placed[x] = np.cumsum(speed) * h
    edges = np.linspace(0, recording.n, parts + 1).astype(int)
    signals = {
        name: values
        for name in ("t", "u", "x1", "x2", "v1", "v2", "xr")
        if (values := placed.get(name, getattr(recording, name))) is not None
    }
    return tuple(
        replace(
            recording, name=f"{recording.name}, part {i + 1}", **{name: values[a:b] for name, values in signals.items()}
        )
        for i, (a, b) in enumerate(pairwise(edges))
    )


def _every_fourth(recordings: Sequence[Recording]) -> set[str]:
    return {r.name for r in recordings[2::4]}


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

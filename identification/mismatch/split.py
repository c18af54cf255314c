"""Which recordings a diagnosis estimates and selects from, by cross-validation, and which it keeps for its report.

Report recordings are not opened until the names are final. They are the closed-loop runs, sines between others in frequency, and
one amplitude of square wave with all its replicates that lies between others, or every fourth recording where there is no such
order: conditions that the fit has not seen and must answer for. A single long recording is cut into blocks; then blocks stand for
recordings, which know less of what differs from run to run.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from flexdrive_gym.recording import FloatArray, Recording

# fewer recordings than this are all needed to estimate and select
_FEWEST = 5
# blocks of a single recording [s], and how many at most
_BLOCK_S, _MOST_BLOCKS = 1.5, 12
# of rest before the first command that is kept [s]: filters and delays begin there
_REST_S = 0.1


@dataclass(frozen=True, eq=False)
class Split:
    """Recordings by what they are for.

    Attributes
    ----------
    estimation
        Cross-validated: each is predicted by the others, which estimate; its score selects.
    report
        Open-loop recordings for the report.
    loops
        Closed-loop recordings for the report.
    blocks
        Whether all are blocks of one recording.
    """

    estimation: tuple[Recording, ...]
    report: tuple[Recording, ...]
    loops: tuple[Recording, ...]
    blocks: bool = False


def split_recordings(recordings: Sequence[Recording]) -> Split:
    """Divide the recordings of one drive.

    Raises
    ------
    ValueError
        If there is nothing to estimate from.
    """
    good = [r for r in recordings if not any(f.id == "duplicate_recording" for f in r.faults)]
    if not good:
        raise ValueError(
            "recordings: needs at least one run of the drive; got none. Record squares and sines (handout 2.5, 2.6)."
        )
    loops = [r for r in good if r.closed_loop]
    runs = [without_rest(r) for r in good if not r.closed_loop]
    if not runs:
        # nothing else: their commands are replayed
        runs, loops = loops, []
    blocks = len(runs) == 1
    if blocks:
        runs = list(cut(runs[0]))
    kept: set[str] = set()
    if len(runs) >= _FEWEST:
        kept |= _sines([r for r in runs if r.excitation.kind == "sine"])
        kept |= _squares([r for r in runs if r.excitation.kind == "square"])
        kept |= _every_fourth([r for r in runs if r.excitation.kind in {"other", "closed_loop"}])
        kept = kept or _every_fourth(runs)
    estimation = tuple(r for r in runs if r.name not in kept)
    return Split(estimation, tuple(r for r in runs if r.name in kept), tuple(loops), blocks)


def without_rest(recording: Recording) -> Recording:
    """Return a recording without the rest before its first command: it says nothing, and takes as long to simulate."""
    if recording.hold != "zero" or recording.faults:
        return recording
    moves = recording.u != recording.u[0]
    for name, y in recording.channels():
        i = int(name[1]) - 1
        reach = 1.5 * recording.quantum[i] / (recording.sample_time if name[0] == "v" else 1.0)
        moves |= np.abs(y - y[0]) > reach
    first = int(np.argmax(moves)) - round(_REST_S / recording.sample_time)
    if recording.u[0] != 0.0 or not moves.any() or first <= 0:
        return recording
    return _part(recording, first, recording.n, recording.name, shifted=True)


def cut(recording: Recording) -> tuple[Recording, ...]:
    """Return the blocks of a recording, at most twelve; they keep its clock and, from velocities if need be, its places."""
    h = recording.sample_time
    blocks = min(int(recording.n * h / _BLOCK_S), _MOST_BLOCKS)
    if blocks < 2:
        return (recording,)
    edges = np.linspace(0, recording.n, blocks + 1).astype(int)
    return tuple(_part(recording, a, b, f"{recording.name}, block {i + 1}") for i, (a, b) in enumerate(pairwise(edges)))


def _part(recording: Recording, a: int, b: int, name: str, *, shifted: bool = False) -> Recording:
    signals: dict[str, FloatArray] = {}
    for key in ("t", "u", "x1", "x2", "v1", "v2", "xr"):
        values = getattr(recording, key)
        speed = getattr(recording, f"v{key[1]}", None) if key in {"x1", "x2"} else None
        if values is None and speed is not None and not shifted:
            values = np.cumsum(speed) * recording.sample_time
        if values is not None:
            signals[key] = values[a:b]
    if shifted:
        signals["t"] = signals["t"] - signals["t"][0]
    return replace(recording, name=name, **signals)  # type: ignore[arg-type]


def _every_fourth(recordings: Sequence[Recording]) -> set[str]:
    return {r.name for r in recordings[2::4]} if len(recordings) > 2 else set()


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

"""Faults of sensors and logs in a data set: reported and masked, never fitted."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from flexdrive_gym.recording import Fault
from identification.recordings.dips import CLUSTER
from identification.recordings.encoder import encoder_faults
from identification.recordings.recognise import find_limit
from identification.recordings.timing import spans

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flexdrive_gym.recording import FloatArray, Recording
    from identification.recordings.motion import Encoder
    from identification.recordings.timing import Uniform

# places of one kind of fault in a recording that are listed one by one
MOST_PLACES = 20
ENCODERS: tuple[Encoder, ...] = ("encoder_1", "encoder_2")
# where a missing value is masked; u and xr concern the run as a whole
_WHERE: dict[str, Encoder] = {"x1": "encoder_1", "v1": "encoder_1", "x2": "encoder_2", "v2": "encoder_2"}


def find_faults(recordings: Sequence[Recording]) -> tuple[Recording, ...]:
    """Attach the faults found in a data set.

    Parameters
    ----------
    recordings
        Runs of one rig. Faults that they have already are kept.

    Returns
    -------
    tuple of Recording
        The same runs in the same order, with faults ``encoder_dropout`` (frozen, or counts lost for a
        moment), ``lost_counts`` (the offset that a freeze leaves in a position), ``duplicate_recording``
        (on the later one) and ``saturation`` (where a closed loop's command rests at its limit;
        informative, nothing is masked).
    """
    faults = [list(recording.faults) for recording in recordings]
    notes = [list(recording.notes) for recording in recordings]
    for where in ENCODERS:
        found, said = encoder_faults(recordings, where)
        for k in range(len(recordings)):
            faults[k] += found[k]
            notes[k] += said[k]
    for k, recording in enumerate(recordings):
        faults[k] += _saturation(recording) + _duplicate(recording, recordings[:k])
    return tuple(
        replace(
            recording,
            faults=merge_faults(faults[k], recording.sample_time),
            notes=tuple(dict.fromkeys(notes[k])),
        )
        for k, recording in enumerate(recordings)
    )


def missing_samples(uniform: Uniform, name: str) -> tuple[Fault, ...]:
    """Return the faults ``missing_samples`` of a run: where its signals are interpolated.

    Parameters
    ----------
    uniform
        Signals of the run; a span missing in all of them, in u or in xr concerns the run as a whole.
    name
        Of the recording.

    Returns
    -------
    tuple of Fault
    """
    faults = [
        Fault(name, _WHERE.get(key, "recording"), "missing_samples", start, end, "interpolated")
        for key, parts in uniform.missing.items()
        for start, end in parts
    ]
    return merge_faults(faults, float(np.median(np.diff(uniform.t))))


def merge_faults(faults: Sequence[Fault], Ts: float) -> tuple[Fault, ...]:
    """Merge faults of one kind whose spans touch, and order all by time.

    Parameters
    ----------
    faults
        Faults of one recording.
    Ts
        Sampling period [s].

    Returns
    -------
    tuple of Fault
    """
    merged: list[Fault] = []
    for fault in sorted(faults, key=lambda f: (f.where, f.id, f.start_s, f.end_s)):
        last = merged[-1] if merged else fault
        # counts lost in quick succession are one fault
        reach = (CLUSTER if fault.id == "encoder_dropout" else 1) + 0.5
        same = bool(merged) and (last.where, last.id) == (fault.where, fault.id)
        if same and fault.start_s - last.end_s < reach * Ts:
            merged[-1] = replace(last, end_s=max(last.end_s, fault.end_s), note=_notes(last.note, fault.note))
        else:
            merged.append(fault)
    return tuple(sorted(merged, key=lambda f: (f.start_s, f.where, f.id)))


def gathered(faults: Sequence[Fault]) -> list[Fault]:
    """Return faults as a person reads them: what a recording has in very many places is one fault, whose note counts them.

    ``saturation`` is left out: it is no fault of a sensor.
    """
    kinds: dict[tuple[str, str, str], list[Fault]] = {}
    for fault in faults:
        if fault.id != "saturation":
            kinds.setdefault((fault.recording, fault.where, fault.id), []).append(fault)
    shown: list[Fault] = []
    for own in kinds.values():
        if len(own) <= MOST_PLACES:
            shown += own
            continue
        counted = f"in {len(own)} places"
        note = f"{counted}; {own[0].note}" if own[0].note else counted
        shown.append(replace(own[0], end_s=max(f.end_s for f in own), note=note))
    return shown


def _notes(first: str, second: str) -> str:
    return "; ".join(dict.fromkeys(note for note in (*first.split("; "), *second.split("; ")) if note))


def _saturation(recording: Recording) -> list[Fault]:
    if not recording.closed_loop:
        return []
    limit, resting = find_limit(recording.u)
    if limit is None:
        return []
    note = f"command at its limit of {recording.units.text(limit, 'V')}"
    return [
        Fault(recording.name, "actuator", "saturation", start, end, note) for start, end in spans(recording.t, resting)
    ]


def _same(first: FloatArray | None, second: FloatArray | None) -> bool:
    if first is None or second is None:
        return first is second
    return bool(np.array_equal(first, second))


def _duplicate(recording: Recording, earlier: Sequence[Recording]) -> list[Fault]:
    """Return the fault of a run whose every number is that of an earlier one; noise never repeats itself."""
    names = ("t", "u", "x1", "x2", "v1", "v2", "xr")
    for other in earlier:
        if all(_same(getattr(recording, name), getattr(other, name)) for name in names):
            start, end = float(recording.t[0]), float(recording.t[-1])
            note = f"identical to {other.name}"
            return [Fault(recording.name, "recording", "duplicate_recording", start, end, note)]
    return []

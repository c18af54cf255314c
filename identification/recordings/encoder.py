"""Faults of one encoder in a data set: frozen readings, lost counts, and what only looks like them.

A cart that is struck may *start* abruptly (a gap in the gear closes), and a reading behind play between
gear and rack resumes abruptly after each reversal. Both *stop* smoothly, and both recur: a standstill that
only ends abruptly is called frozen only where such standstills are rare in the whole data set. Events
that keep time with the drive are impacts, and jolts that come back at one place of the cart in several runs
are a tooth's or a joint's: neither is a fault.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from flexdrive_gym.recording import Fault
from identification.recordings.dips import Dip, find_dips
from identification.recordings.freezes import RARE, Standstill, find_standstills, lasting
from identification.recordings.motion import Encoder, channel, encoder_speed, leaps, other_rests, other_travel

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flexdrive_gym.recording import FloatArray, Recording

ROUNDED = 2.0  # counts by which a difference of readings may be off
RECURRING = 3  # events at one phase of the drive
PLACE = 0.3  # mm within which jolts of several runs are at one place, about a third of a tooth
UNMOVED = 5.0  # mm that the other cart travels while a dead encoder never counts

_Event = TypeVar("_Event", Standstill, Dip)


def encoder_faults(recordings: Sequence[Recording], where: Encoder) -> tuple[list[list[Fault]], list[list[str]]]:
    """Find the faults of one encoder in a data set.

    Parameters
    ----------
    recordings
        Runs of one rig.
    where
        The encoder.

    Returns
    -------
    faults : list of list of Fault
        Per recording: ``encoder_dropout`` where the reading is frozen or lost counts for a moment, and
        ``lost_counts`` from the end of a freeze on where positions were recorded.
    notes : list of list of str
        Per recording: what was seen and is no fault.
    """
    channels = [encoder_speed(recording, where) for recording in recordings]
    stills = [[] if counted is None else find_standstills(*counted) for counted in channels]
    sudden = [[s for s in found if s.starts_abruptly and not s.stops_abruptly] for found in stills]
    # play shows in all its restarts, also in those that alone would be in doubt
    played = sum(s.resumes_at_speed and not s.stops_abruptly for found in stills for s in found) > RARE
    jolts = [
        _dips(recording, speed, still, where)
        for recording, speed, still in zip(recordings, channels, stills, strict=True)
    ]
    placed = _placed(recordings, jolts, where)
    faults: list[list[Fault]] = []
    notes: list[list[str]] = []
    for k, recording in enumerate(recordings):
        said = [note] if (note := _idle(recording, where)) else []
        frozen = [s for s in stills[k] if s.stops_abruptly]
        if played and sudden[k]:
            said.append(f"{where}: {len(sudden[k])} standstills end abruptly, as behind play: no fault")
        elif not played:
            # a drive starts at rest, so a reading that starts late needs the other cart as a witness
            frozen += [s for s in sudden[k] if s.first > 1 or not other_rests(recording, where, s.first, s.last)]
        frozen, struck = _sporadic(recording, frozen, stills[k])
        long = [s for s in lasting(recording, channels[k], stills[k]) if s not in frozen]
        frozen += [s for s in long if not other_rests(recording, where, s.first, s.last)]
        found = [fault for still in frozen for fault in _freeze(recording, where, still)]
        if channels[k] is not None:
            dips, jolted = _sporadic(recording, jolts[k], jolts[k])
            found += [_momentary(recording, where, dip) for dip in dips if dip not in placed[k]] + _leaps(
                recording, where
            )
            struck += jolted
        if placed[k]:
            one = len(placed[k]) == 1
            what = "a jolt comes back" if one else f"{len(placed[k])} jolts come back"
            said.append(f"{where}: {what} at one place in several runs, as at a tooth: no fault")
        if struck:
            said.append(f"{where}: {struck} jolts recur with the drive, as impacts in a gap do: no fault")
        faults.append(found + _dead(recording, where))
        notes.append(said)
    return faults, notes


def _dips(
    recording: Recording, speed: tuple[FloatArray, float] | None, stills: Sequence[Standstill], where: Encoder
) -> list[Dip]:
    """Return the moments of a run at which counts seem lost; a reading that is off by a count or two is rounded."""
    if speed is None:
        return []
    least = ROUNDED * recording.quantum[int(where[-1]) - 1] / recording.sample_time
    return [dip for dip in find_dips(*speed, stills) if abs(dip.lost) > least]


def _placed(recordings: Sequence[Recording], jolts: Sequence[list[Dip]], where: Encoder) -> list[list[Dip]]:
    """Return, run by run, the jolts within :data:`PLACE` of which those of at least :data:`RECURRING` runs lie."""
    places = [
        [] if (x := channel(recording, f"x{where[-1]}")) is None else [float(x[dip.first]) for dip in dips]
        for recording, dips in zip(recordings, jolts, strict=True)
    ]

    def recurs(place: float) -> bool:
        return sum(any(abs(other - place) <= PLACE for other in run) for run in places) >= RECURRING

    return [
        [dip for dip, place in zip(dips, run, strict=False) if recurs(place)]
        for dips, run in zip(jolts, places, strict=True)
    ]


def _freeze(recording: Recording, where: Encoder, still: Standstill) -> list[Fault]:
    """Return a freeze, with the samples that its edges cut, and the offset that it leaves in a position."""
    t, end = recording.t, recording.n - 1
    start, stop = max(still.first - 1, 0), min(still.last + 1, end)
    note = "frozen, then caught up at once" if still.catches_up else "frozen"
    faults = [Fault(recording.name, where, "encoder_dropout", float(t[start]), float(t[stop]), note)]
    if channel(recording, f"x{where[-1]}") is not None and still.last < end and not still.catches_up:
        note = _loss(recording, where, still, start, stop)
        faults.append(Fault(recording.name, where, "lost_counts", float(t[stop]), float(t[end]), note))
    return faults


def _loss(recording: Recording, where: Encoder, still: Standstill, start: int, stop: int) -> str:
    """Estimate the travel that a freeze swallowed.

    The speeds at its edges tell for a short one; for a long one the other cart, which the spring ties to
    this one, says about how far both went.
    """
    by_speed = 0.5 * (still.before + still.after) * (stop - start) * recording.sample_time
    mm = partial(recording.units.text, unit="mm", digits=3)
    text = f"about {mm(by_speed)} lost by the speeds at the freeze's edges"
    other = channel(recording, "x2" if where == "encoder_1" else "x1")
    return text if other is None else f"{text}, {mm(float(other[stop] - other[start]))} by the other cart"


def _momentary(recording: Recording, where: Encoder, dip: Dip) -> Fault:
    size = abs(dip.lost) * recording.sample_time
    note = f"{'lost' if dip.lost > 0.0 else 'gained'} counts, about {recording.units.text(size, 'mm', 2)}"
    start, end = float(recording.t[dip.first]), float(recording.t[dip.last])
    return Fault(recording.name, where, "encoder_dropout", start, end, note)


def _leaps(recording: Recording, where: Encoder) -> list[Fault]:
    """Return the samples in which position or velocity leap as no cart can."""
    t, cart = recording.t, where[-1]
    speeds = [channel(recording, f"v{cart}")]
    if (x := channel(recording, f"x{cart}")) is not None:
        speeds.append(np.diff(x, prepend=x[0]) / recording.sample_time)
    return [
        Fault(recording.name, where, "encoder_dropout", float(t[first]), float(t[last]), "leaps")
        for speed in speeds
        if speed is not None
        for first, last in leaps(speed)
    ]


def _sporadic(recording: Recording, events: list[_Event], all_events: Sequence[_Event]) -> tuple[list[_Event], int]:
    """Drop events that recur at one phase of the drive: faults are sporadic, impacts in a gap keep time.

    Parameters
    ----------
    recording
        The run, whose excitation gives the period.
    events
        Candidates.
    all_events
        All events of their kind, however weak. A candidate recurs if three of these, itself included, start and
        end at its phase.

    Returns
    -------
    events : list
        Those that do not recur.
    recurring : int
        Number of those that do.
    """
    frequency, Ts = recording.excitation.frequency, recording.sample_time
    if frequency <= 0.0 or not events or len(all_events) < RECURRING:
        return events, 0
    half = 0.5 / (frequency * Ts)  # samples: what a symmetric drive does both ways comes twice a period
    near = max(2.0, min(0.05 * half, 0.01 / Ts))
    recurring = 0
    sporadic = []
    for event in events:
        shift = np.array([(other.first - event.first, other.last - event.last) for other in all_events])
        apart = np.abs((shift + 0.5 * half) % half - 0.5 * half)
        # an event that outlasts the half-period is no impact, whatever its phase
        if event.last - event.first < half and np.sum(np.all(apart <= near, axis=1)) >= RECURRING:
            recurring += 1
        else:
            sporadic.append(event)
    return sporadic, recurring


def _never_counts(recording: Recording, where: Encoder) -> float:
    """Return the travel of the other cart [mm] if this encoder never counts, else 0."""
    speed = encoder_speed(recording, where)
    if speed is None or speed[0].any():
        return 0.0
    travel = other_travel(recording, where)
    return travel if travel > UNMOVED else 0.0


def _dead(recording: Recording, where: Encoder) -> list[Fault]:
    """Return the fault of an encoder 1 that never counts: only through cart 1 can cart 2 be moved."""
    travel = _never_counts(recording, where)
    if where != "encoder_1" or travel == 0.0:
        return []
    note = f"never counts while cart 2 travels {recording.units.text(travel, 'mm', 3)}"
    start, end = float(recording.t[0]), float(recording.t[-1])
    return [Fault(recording.name, where, "encoder_dropout", start, end, note)]


def _idle(recording: Recording, where: Encoder) -> str | None:
    """Return a note on an encoder 2 that never counts: friction or an uncoupled spring may hold cart 2."""
    travel = _never_counts(recording, where)
    if where != "encoder_2" or travel == 0.0:
        return None
    return (
        f"encoder_2 never counts while cart 1 travels {recording.units.text(travel, 'mm', 3)}: uncoupled, held or dead"
    )

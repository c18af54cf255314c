"""The loop that drives a rig: a command for every sample, and 0 V on every way out."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from math import inf, isfinite
from time import perf_counter

import numpy as np

from baselines.rig.protocol import Limits, Reading, Rig, RigStopped
from baselines.rig.timing import Timing
from flexdrive_gym import Observation, Recording
from flexdrive_gym.drive.simulate import command_of
from flexdrive_gym.recording import FloatArray

# |u| counts as resting against the limit from here on
_AT_LIMIT = 0.999
# a rig takes its time to begin
_START_S = 1.0


@dataclass(frozen=True, eq=False)
class Run:
    """One run of a rig.

    Attributes
    ----------
    recording
        Positions from where the carts stood at its start; ``u`` is what was put out. Lost samples are missing rows.
    timing
    lost
        Number of lost samples.
    zero
        Where the carts stood at its start, by the rig's zero [mm].
    """

    recording: Recording
    timing: Timing
    lost: int
    zero: tuple[float, float]


@dataclass
class _Log:
    """What the loop writes down, a row per sample."""

    rows: list[tuple[float, float, float, float, float, float]] = field(default_factory=list)
    u: list[float] = field(default_factory=list)
    timing: Timing = field(default_factory=Timing)
    lost: int = 0
    note: str = ""
    zero: tuple[float, float] = (0.0, 0.0)


def run(
    rig: Rig,
    controller: Callable[[Observation], float],
    reference: FloatArray,
    limits: Limits | None = None,
    *,
    name: str = "run",
) -> Run:
    """Drive a rig for as many samples as there are values of the reference.

    Parameters
    ----------
    rig
        Stands still; when this returns or raises it has been told to put out 0 V.
    controller
        Asked once per sample, returns the command [V].
    reference : ndarray, shape (n,)
        xr at the rig's samples, from where the carts stand at the start [mm].
    limits
        What stops the motor, on top of the rig's own limits. A cart that leaves the travel ends the run with what was recorded,
        as the STOP button does.
    name
        Name of the recording.

    Raises
    ------
    RigStopped
        For a late sample, lost samples, a lost peer, and a command that rests against its limit.
    Exception
        What the controller raises, Ctrl-C included.
    """
    told = rig.description
    strict = (limits or Limits()).within(told.limits)
    reset = getattr(controller, "reset", None)
    if reset is not None:
        reset()
    log = _Log()
    try:
        with _no_collection():
            rig.start(strict.watchdog)
            _loop(rig, controller, np.asarray(reference, dtype=np.float64).tolist(), strict, log)
    finally:
        rig.stop()
    return Run(_recording(rig, log, reference, name), log.timing, log.lost, log.zero)


def _loop(rig: Rig, controller: Callable[[Observation], float], xr: list[float], limits: Limits, log: _Log) -> None:
    period, real_time = rig.description.period, rig.description.real_time
    reading = rig.read(max(limits.watchdog, _START_S))
    arrived = perf_counter()
    log.zero = zero_1, zero_2 = reading.x1, reading.x2
    inside = False
    begin, earliest = arrived - reading.t, 0.0
    before: tuple[int, float, float] | None = None
    rests_since = inf
    while True:
        x1, x2 = reading.x1 - zero_1, reading.x2 - zero_2
        v1, v2 = _velocities(reading, (x1, x2), before, period)
        seen = Observation(reading.t, xr[reading.sequence], x1, x2, v1, v2)
        log.rows.append((seen.t, seen.xr, x1, x2, v1, v2))
        beyond = max(reading.x1, reading.x2, key=abs)
        inside = inside or abs(beyond) <= limits.travel
        outside = inside and abs(beyond) > limits.travel
        if outside:
            log.note = f"ended at {seen.t:.3f} s: a cart left the travel of ±{limits.travel:g} mm"
            u = 0.0
        else:
            u = _clipped(command_of(controller, seen), limits.voltage)
        if not inside and u * beyond > 0.0:
            u = 0.0  # a run that starts beyond the travel may only lead back
        # what rests against the limit pushes the same way all the while
        if abs(u) < _AT_LIMIT * limits.voltage or (log.u and u * log.u[-1] <= 0.0):
            rests_since = inf
        elif seen.t - (rests_since := min(rests_since, seen.t)) > limits.resting:
            raise RigStopped(
                "command limit",
                f"the command rested at {u:+.3g} V for {limits.resting:g} s at t = {seen.t:.3f} s. Look for a swapped sign of an "
                "encoder or a cart that is held; lower the gain.",
            )
        rig.write(u)
        log.timing.response.append(perf_counter() - arrived)
        log.u.append(u)
        before = (reading.sequence, x1, x2)
        last, last_arrived = reading, arrived
        # one sample more than is recorded tells what was put out since the last one
        if outside:
            return
        reading = rig.read(limits.watchdog)
        arrived = perf_counter()
        log.u[-1] = reading.u
        if reading.latency is not None:
            log.timing.latency.append(reading.latency)
        _check_lost(last, reading, limits.late, period, log)
        if real_time:
            log.timing.jitter.append(abs(arrived - last_arrived - (reading.t - last.t)))
            lag = arrived - begin - reading.t
            earliest = min(earliest, lag)
            if lag - earliest > limits.late:
                raise RigStopped(
                    "late sample",
                    f"the sample of t = {reading.t:.3f} s came {1e3 * (lag - earliest):.1f} ms late; {1e3 * limits.late:g} ms are "
                    "allowed. Give this computer less to do, or allow more with --late.",
                )
        if reading.sequence >= len(xr):
            return


def _check_lost(last: Reading, now: Reading, late: float, period: float, log: _Log) -> None:
    lost = now.sequence - last.sequence - 1
    if lost * period > late:
        raise RigStopped(
            "late sample",
            f"{lost} samples after t = {last.t:.3f} s were lost, {1e3 * lost * period:g} ms; {1e3 * late:g} ms are allowed. Mend the "
            "line, or allow more with --late.",
        )
    log.lost += lost


def _velocities(
    reading: Reading, now: tuple[float, float], before: tuple[int, float, float] | None, period: float
) -> tuple[float, float]:
    """Return what the rig says, or the raw differences of positions; 0 at the first sample [mm/s]."""
    if reading.v1 is not None and reading.v2 is not None:
        return reading.v1, reading.v2
    if before is None:
        return 0.0, 0.0
    step = (reading.sequence - before[0]) * period
    return (now[0] - before[1]) / step, (now[1] - before[2]) / step


def _clipped(u: float, limit: float) -> float:
    if not isfinite(u):
        raise RigStopped("command limit", f"the controller asked for {u} V.")
    return min(max(u, -limit), limit)


def _recording(rig: Rig, log: _Log, reference: FloatArray, name: str) -> Recording:
    told = rig.description
    t, xr, x1, x2, v1, v2 = np.array(log.rows).T.copy()
    two = told.carts == 2
    return Recording(
        name=name,
        t=t,
        u=np.array(log.u),
        xr=xr,
        x1=x1,
        x2=x2 if two else None,
        v1=v1,
        v2=v2 if two else None,
        quantum=told.quantum,
        notes=(log.note,) if log.note else (),
        source=told.name,
    )


@contextmanager
def _no_collection() -> Iterator[None]:
    """Have no sample wait for the collection of garbage."""
    on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if on:
            gc.enable()

"""The loop that drives a rig: a command for every sample, and 0 V on every way out."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from math import inf, isfinite
from time import perf_counter

import numpy as np

from baselines.rig.protocol import Description, Limits, Reading, Rig, RigStopped
from baselines.rig.timing import Timing
from flexdrive_gym import Observation, Recording
from flexdrive_gym.drive.controller import command_of
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
    clock: Callable[[], float] = perf_counter,
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
    clock
        This computer's [s], by which samples are late.

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
            _loop(rig, controller, np.asarray(reference, dtype=np.float64).tolist(), strict, log, clock)
    finally:
        rig.stop()
    return Run(_recording(rig, log, name), log.timing, log.lost, log.zero)


def _loop(
    rig: Rig,
    controller: Callable[[Observation], float],
    xr: list[float],
    limits: Limits,
    log: _Log,
    clock: Callable[[], float],
) -> None:
    """Run until the reference or the travel ends; one sample more than is recorded tells what was put out since the last."""
    guard = _Guard(limits, rig.description)
    reading = rig.read(max(limits.watchdog, _START_S))
    arrived = clock()
    guard.begin(reading, arrived)
    log.zero = reading.x1, reading.x2
    before: tuple[int, float, float] | None = None
    while reading.sequence < len(xr):
        x1, x2 = reading.x1 - log.zero[0], reading.x2 - log.zero[1]
        v1, v2 = _velocities(reading, (x1, x2), before, rig.description.period)
        before = (reading.sequence, x1, x2)
        seen = Observation(reading.t, xr[reading.sequence], x1, x2, v1, v2)
        log.rows.append((seen.t, seen.xr, x1, x2, v1, v2))
        if guard.outside(reading):
            rig.write(0.0)
            log.u.append(0.0)
            log.note = f"ended at {seen.t:.3f} s: a cart left the travel of ±{limits.travel:g} mm"
            return
        u = guard.allowed(command_of(controller, seen), reading)
        rig.write(u)
        log.timing.response.append(clock() - arrived)
        reading = rig.read(limits.watchdog)
        arrived = clock()
        log.u.append(reading.u)
        if reading.latency is not None:
            log.timing.latency.append(reading.latency)
        guard.arrival(reading, arrived, log)


class _Guard:
    """Watches one run, and raises where the motor must stop."""

    def __init__(self, limits: Limits, told: Description) -> None:
        self.limits, self.period, self.real_time = limits, told.period, told.real_time
        self._inside = False
        self._rests_since, self._u = inf, 0.0

    def begin(self, first: Reading, arrived: float) -> None:
        """Take the first sample as that which came in time."""
        self._last, self._arrived = first, arrived
        self._earliest = arrived - first.t

    def outside(self, reading: Reading) -> bool:
        """Tell whether a cart left the travel in this run."""
        beyond = max(abs(reading.x1), abs(reading.x2)) > self.limits.travel
        self._inside = self._inside or not beyond
        return beyond and self._inside

    def allowed(self, asked: float, reading: Reading) -> float:
        """Return the command that may be put out instead of the one that was asked for."""
        limit = self.limits.voltage
        if not isfinite(asked):
            raise RigStopped("command limit", f"the controller asked for {asked} V.")
        u = min(max(asked, -limit), limit)
        if not self._inside and u * max(reading.x1, reading.x2, key=abs) > 0.0:
            u = 0.0  # a run that starts beyond the travel may only lead back
        # what rests against the limit pushes one way all the while
        if abs(u) < _AT_LIMIT * limit or u * self._u <= 0.0:
            self._rests_since = inf
        if abs(u) >= _AT_LIMIT * limit:
            self._rests_since = min(self._rests_since, reading.t)
            if reading.t - self._rests_since > self.limits.resting:
                raise RigStopped(
                    "command limit",
                    f"the command rested at {u:+.3g} V for {self.limits.resting:g} s at t = {reading.t:.3f} s. Look for a "
                    "swapped sign of an encoder or a cart that is held; lower the gain.",
                )
        self._u = u
        return u

    def arrival(self, now: Reading, arrived: float, log: _Log) -> None:
        """Look at a sample's number and time."""
        late, last = self.limits.late, self._last
        lost = now.sequence - last.sequence - 1
        log.lost += lost
        if lost * self.period > late:
            raise RigStopped(
                "late sample",
                f"{lost} samples after t = {last.t:.3f} s were lost, {1e3 * lost * self.period:g} ms; {1e3 * late:g} ms are "
                "allowed. Mend the line, or allow more with --late.",
            )
        if self.real_time:
            log.timing.jitter.append(abs(arrived - self._arrived - (now.t - last.t)))
            self._earliest = min(self._earliest, arrived - now.t)
            behind = arrived - now.t - self._earliest
            if behind > late:
                raise RigStopped(
                    "late sample",
                    f"the sample of t = {now.t:.3f} s came {1e3 * behind:.1f} ms late; {1e3 * late:g} ms are allowed. Give this "
                    "computer less to do, or allow more with --late.",
                )
        self._last, self._arrived = now, arrived


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


def _recording(rig: Rig, log: _Log, name: str) -> Recording:
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
        source="simulated" if told.returns else told.name,
        units=told.units,
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

"""A rig at the other end of a link, in the format of :mod:`baselines.rig.wire`."""

from __future__ import annotations

from secrets import randbelow
from time import perf_counter

from baselines.rig.links import Frames, Link, SerialLink
from baselines.rig.protocol import Description, Reading, RigStopped
from baselines.rig.wire import NO_LATENCY, SIZES, VERSION, Frame, Kind, Reason, description, micro

_ASKS, _PATIENCE_S = 10, 0.2
_STOPS, _STOP_PATIENCE_S = 5, 0.02
_BITS_PER_BYTE = 10  # with start and stop bit
_WHY = {
    Reason.WATCHDOG: ("watchdog", "had no command for its watchdog's time. Give it a longer one, or this computer less to do."),
    Reason.TRAVEL: ("travel", "found a cart beyond its own limit of travel. Bring the carts to the middle."),
    Reason.ASKED: ("stopped", "was stopped by somebody else."),
}  # fmt: skip


class RemoteRig:
    """A rig that speaks frames.

    Parameters
    ----------
    link
        To the rig; :meth:`close` closes it.

    Raises
    ------
    RigStopped
        If no rig answers.
    ValueError
        If what answers is no rig this program can drive, or the line is too slow for its period.
    """

    def __init__(self, link: Link) -> None:
        self._frames = Frames(link)
        self.name = link.name
        try:
            self.description = self._introduction()
            self._check_line(link)
        except BaseException:
            link.close()
            raise
        self._sequence, self._run = -1, randbelow(2**31)

    def _introduction(self) -> Description:
        self.stop()  # whatever an earlier program left running
        for _ in range(_ASKS):
            self._frames.send(Frame(Kind.HELLO))
            until = perf_counter() + _PATIENCE_S
            while (left := until - perf_counter()) > 0.0:
                frame = self._frames.receive(left)
                if frame is not None and frame.kind is Kind.DESCRIPTION:
                    return description(frame)
        other = self._frames.scanner.other_version
        if other is not None:
            raise ValueError(
                f"rig: {self.name} speaks version {other} of the format; this program speaks {VERSION} (docs/rig.md)."
            )
        raise RigStopped(
            "lost peer",
            f"no rig answers at {self.name} within {_ASKS * _PATIENCE_S:g} s. Switch it on, or name another address.",
        )

    def _check_line(self, link: Link) -> None:
        if not isinstance(link, SerialLink):
            return
        least = _BITS_PER_BYTE * SIZES[Kind.READING] / self.description.period
        if link.baud < least:
            raise ValueError(
                f"baud: a sample every {1e3 * self.description.period:g} ms needs {least:.0f} baud at least; got {link.baud}. "
                "Use a faster line, or a longer period on the rig."
            )

    def start(self, watchdog: float) -> None:
        """Begin a run."""
        self._frames.drain()
        self._sequence, self._run = -1, self._run + 1
        self._frames.send(Frame(Kind.START, self._run, values=(micro(watchdog),)))

    def read(self, timeout: float) -> Reading:
        """Wait for the next sample; older ones that arrive after it are dropped."""
        until = perf_counter() + timeout
        while True:
            frame = self._frames.receive(max(until - perf_counter(), 0.0))
            if frame is None:
                raise RigStopped(
                    "lost peer", f"{self.name} sent no sample for {timeout:g} s. Look at its power and its line."
                )
            if frame.kind is Kind.STOPPED and frame.sequence == self._run:
                reason, sentence = _WHY[Reason(int(frame.values[0]))]
                raise RigStopped(reason, f"{self.name} {sentence}")
            # what is left of an earlier run does not begin with 0
            if frame.kind is Kind.READING and (
                frame.sequence > self._sequence >= 0 or frame.sequence == 0 > self._sequence
            ):
                break
        self._sequence = frame.sequence
        count_1, count_2, u, latency = frame.values
        quantum_1, quantum_2 = self.description.quantum
        return Reading(
            frame.sequence,
            frame.time_us / 1e6,
            int(count_1) * quantum_1,
            int(count_2) * quantum_2,
            float(u),
            latency=None if latency == NO_LATENCY else float(latency) / 1e6,
        )

    def write(self, u: float) -> None:
        """Answer the last sample with a command [V]."""
        self._frames.send(Frame(Kind.COMMAND, self._sequence, values=(u,)))

    def stop(self) -> None:
        """Ask for 0 V until the rig says that it has stopped, a few times; after that its watchdog does it."""
        for _ in range(_STOPS):
            try:
                self._frames.send(Frame(Kind.STOP))
                until = perf_counter() + _STOP_PATIENCE_S
                while (left := until - perf_counter()) > 0.0:
                    frame = self._frames.receive(left)
                    if frame is not None and frame.kind is Kind.STOPPED:
                        return
            except OSError:
                return

    def close(self) -> None:
        """Stop, and close the link."""
        self.stop()
        self._frames.link.close()

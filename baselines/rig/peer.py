"""The reference peer: a simulated drive at the rig's end of a link, in the format of :mod:`baselines.rig.wire`.

``python -m baselines.rig.peer drive.toml --udp 127.0.0.1:5005`` (or ``--serial /dev/ttyUSB1``, or ``--pty`` for a
pseudo-terminal) is a rig for ``flexdrive experiment --rig …``. It shows what a rig's own program has to do, watchdog and
travel limit included; it is no hardware, and no real-time system either.
"""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Callable
from dataclasses import replace
from time import perf_counter

from baselines.rig.links import Frames, Link, PtyLink, SerialLink, UdpPeerLink
from baselines.rig.protocol import Description, Reading
from baselines.rig.simulated import PERIOD_S, SimulatedRig
from baselines.rig.wire import NO_LATENCY, Frame, Kind, Reason, described, micro

WATCHDOG_S = 0.05
TRAVEL_MM = 250.0
_IDLE_S = 0.05


class Peer:
    """A simulated drive that is driven over a link.

    Parameters
    ----------
    plant
        Keeps its place between runs (``returns=False``), as a rig does.
    link
        To the program that drives.
    watchdog
        After how long without a command 0 V is put out [s]; a run may ask for a shorter time.
    lockstep
        Let the plant's clock wait for every command, which is put out from its own sample on. Otherwise samples are taken at the
        period on the wall's clock, and a command is put out from the sample after it came on.
    tell
        Is given a sentence for what happens.
    """

    def __init__(
        self,
        plant: SimulatedRig,
        link: Link,
        *,
        watchdog: float = WATCHDOG_S,
        lockstep: bool = False,
        tell: Callable[[str], None] = lambda _sentence: None,
    ) -> None:
        self.plant, self.frames, self.lockstep = plant, Frames(link), lockstep
        told = plant.description
        self.description: Description = replace(
            told, real_time=not lockstep, limits=replace(told.limits, watchdog=watchdog)
        )
        self._tell = tell
        self._reason, self._run_number = Reason.ASKED, 0
        # compiled before anybody waits; at rest nothing moves
        plant.start(watchdog)
        plant.read()
        plant.read()
        plant.stop()

    @property
    def output(self) -> float:
        """What is put out [V]."""
        return self.plant.output

    def serve(self, until: Callable[[], bool] = lambda: False) -> None:
        """Answer, one run after another, until told to end."""
        try:
            while not until():
                frame = self.frames.receive(_IDLE_S)
                if frame is None:
                    continue
                if frame.kind is Kind.HELLO:
                    self.frames.send(described(self.description))
                elif frame.kind is Kind.START:
                    self._run_number = frame.sequence
                    self._serve_run(float(frame.values[0]) / 1e6, until)
                elif frame.kind in (Kind.STOP, Kind.COMMAND):
                    # what is already at 0 V says so again: the first answer may be lost
                    self._say_stopped()
        finally:
            self.plant.close()
            self.frames.link.close()

    def _serve_run(self, asked: float, until: Callable[[], bool]) -> None:
        watchdog = min(self.description.limits.watchdog, asked)
        self._exclude(True)
        try:
            self.plant.start(watchdog)
            self._reason = self._run(watchdog, until)
        finally:
            self.plant.stop()
            self._exclude(False)
        self._tell(f"run ended: {self._reason.name.lower()}; {self.output:g} V")
        self._say_stopped()

    def _exclude(self, yes: bool) -> None:
        if isinstance(self.frames.link, UdpPeerLink):
            self.frames.link.exclusive = yes

    def _say_stopped(self) -> None:
        self.frames.send(Frame(Kind.STOPPED, self._run_number, values=(self._reason,)))

    def _run(self, watchdog: float, until: Callable[[], bool]) -> Reason:
        """Serve one run; return why it ended."""
        period, travel = self.description.period, self.description.limits.travel
        latency, inside, waiting = NO_LATENCY, False, 0.0
        tick = heard = perf_counter()
        while not until():
            reading = self.plant.read()
            taken = perf_counter()
            if not self.lockstep:
                self.plant.write(waiting)
            self._send(reading, latency)
            beyond = max(reading.x1, reading.x2, key=abs)
            inside = inside or abs(beyond) <= travel
            if inside and abs(beyond) > travel:
                return Reason.TRAVEL
            tick += period
            command: float | None = None
            while not (self.lockstep and command is not None):
                due = heard + watchdog if self.lockstep else min(heard + watchdog, tick)
                frame = self.frames.receive(max(due - perf_counter(), 0.0))
                if frame is None and (self.lockstep or perf_counter() >= heard + watchdog):
                    return Reason.WATCHDOG
                if frame is None:
                    break
                if frame.kind is Kind.STOP:
                    return Reason.ASKED
                if frame.kind is Kind.COMMAND and (frame.sequence == reading.sequence or not self.lockstep):
                    command, heard = float(frame.values[0]), perf_counter()
                    if frame.sequence == reading.sequence:
                        latency = micro(heard - taken)
            if command is not None:
                limit = self.description.limits.voltage
                command = min(max(command, -limit), limit)
                # a run that starts beyond the travel may only lead back
                waiting = command if inside or command * beyond <= 0.0 else 0.0
                if self.lockstep:
                    self.plant.write(waiting)
        return Reason.ASKED

    def _send(self, reading: Reading, latency: int) -> None:
        quantum = self.description.quantum
        counts = (
            round(x / q) if q > 0.0 else 0 for x, q in zip((reading.x1, reading.x2), quantum, strict=True)
        )  # fmt: skip
        self.frames.send(
            Frame(Kind.READING, reading.sequence, micro(reading.t), (*counts, reading.u, latency))
        )  # fmt: skip


def main(arguments: list[str] | None = None) -> int:
    """Be a rig until Ctrl-C."""
    from flexdrive_gym import load_drive  # noqa: PLC0415  (--help stays quick)

    parser = argparse.ArgumentParser(
        prog="python -m baselines.rig.peer", description=__doc__.partition("\n")[0] if __doc__ else ""
    )
    parser.add_argument("drive", help="a drive.toml")
    where = parser.add_mutually_exclusive_group(required=True)
    where.add_argument("--udp", metavar="HOST:PORT", help="port 0: any that is free")
    where.add_argument("--serial", metavar="PATH", help="a serial line (extra 'rig')")
    where.add_argument("--pty", action="store_true", help="a pseudo-terminal, whose name is printed")
    parser.add_argument("--baud", type=int, default=921600)
    parser.add_argument("--period", type=float, default=1e3 * PERIOD_S, metavar="MS")
    parser.add_argument("--travel", type=float, default=TRAVEL_MM, metavar="MM")
    parser.add_argument("--watchdog", type=float, default=1e3 * WATCHDOG_S, metavar="MS")
    parser.add_argument(
        "--lockstep", action="store_true", help="wait for every command instead of keeping the wall's time"
    )
    given = parser.parse_args(arguments)
    try:
        plant = SimulatedRig(
            load_drive(given.drive), period=given.period / 1e3, travel=given.travel, returns=False
        )  # fmt: skip
        peer = Peer(plant, _link(given), watchdog=given.watchdog / 1e3, lockstep=given.lockstep, tell=_print)
    except (ValueError, OSError) as error:
        parser.error(str(error))
    for number in (signal.SIGINT, signal.SIGTERM):  # the first one is ignored in a shell's background
        signal.signal(number, signal.default_int_handler)
    _print(f"rig at {_address(peer.frames.link)}")
    try:
        peer.serve()
    except KeyboardInterrupt:
        _print("ended")
    return 0


def _link(given: argparse.Namespace) -> Link:
    if given.pty:
        return PtyLink()
    if given.serial:
        return SerialLink(given.serial, given.baud)
    host, _, port = given.udp.rpartition(":")
    if not host or not port.isdecimal():
        raise ValueError(f"--udp: must be HOST:PORT; got {given.udp!r}. Try 127.0.0.1:5005.")
    return UdpPeerLink(host.strip("[]"), int(port))


def _address(link: Link) -> str:
    return f"serial://{link.name}" if isinstance(link, PtyLink) else link.name


def _print(sentence: str) -> None:
    print(sentence, flush=True)


if __name__ == "__main__":
    sys.exit(main())

"""How frames travel: UDP datagrams, a serial line."""

from __future__ import annotations

import os
import select
import socket
from collections import deque
from time import perf_counter
from typing import Any, Protocol

from baselines.rig.protocol import RigStopped
from baselines.rig.wire import Frame, Scanner

_MOST_BYTES = 4096


class Link(Protocol):
    """Bytes to and from the other side; both ends have one."""

    name: str

    def send(self, data: bytes) -> None:
        """Send; what cannot be sent is lost, as a datagram may be."""

    def receive(self, timeout: float) -> bytes:
        """Return what came within the timeout [s]; empty where nothing did."""

    def close(self) -> None:
        """Give up the connection."""


class Frames:
    """Frames over a link."""

    def __init__(self, link: Link) -> None:
        self.link = link
        self.scanner = Scanner()
        self._waiting: deque[Frame] = deque()

    def send(self, frame: Frame) -> None:
        """Send one frame."""
        self.link.send(frame.pack())

    def receive(self, timeout: float) -> Frame | None:
        """Return the next frame, ``None`` where none came within the timeout [s]."""
        until = perf_counter() + timeout
        while not self._waiting:
            left = until - perf_counter()
            data = self.link.receive(max(left, 0.0))
            self._waiting.extend(self.scanner.feed(data))
            if not self._waiting and left <= 0.0:
                return None
        return self._waiting.popleft()

    def drain(self) -> None:
        """Forget what came so far."""
        while self.receive(0.0) is not None:
            pass


def _readable(file: Any, timeout: float) -> bool:
    """Wait for data. A socket's own timeout is rounded up to milliseconds, a sample's whole period."""
    return bool(select.select([file], [], [], timeout)[0])


class UdpLink:
    """The program's end: datagrams to one rig, and from it alone."""

    def __init__(self, host: str, port: int) -> None:
        self.name = f"udp://{host}:{port}"
        family, kind, protocol, _name, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        self._socket = socket.socket(family, kind, protocol)
        self._socket.connect(address)

    def send(self, data: bytes) -> None:
        """Send a datagram.

        Raises
        ------
        RigStopped
            If the other side says that nobody listens.
        """
        try:
            self._socket.send(data)
        except OSError as error:
            raise RigStopped("lost peer", f"nothing can be sent to {self.name} ({error}).") from error

    def receive(self, timeout: float) -> bytes:
        """Return a datagram, or nothing.

        Raises
        ------
        RigStopped
            If the other side says that nobody listens.
        """
        if not _readable(self._socket, timeout):
            return b""
        try:
            return self._socket.recv(_MOST_BYTES)
        except OSError as error:
            raise RigStopped("lost peer", f"nobody listens at {self.name} ({error}).") from error

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


class UdpPeerLink:
    """A rig's end: whoever speaks is answered, and while a run is on nobody else is heard."""

    def __init__(self, host: str, port: int) -> None:
        self._socket = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((host, port))
        self.port: int = self._socket.getsockname()[1]
        self.name = f"udp://{host}:{self.port}"
        self._other: Any = None
        self.exclusive = False

    def send(self, data: bytes) -> None:
        """Send to whoever spoke last."""
        if self._other is not None:
            self._socket.sendto(data, self._other)

    def receive(self, timeout: float) -> bytes:
        """Return a datagram, or nothing."""
        if not _readable(self._socket, timeout):
            return b""
        try:
            data, sender = self._socket.recvfrom(_MOST_BYTES)
        except OSError:  # the other side is gone: the watchdog's matter
            return b""
        if self.exclusive and sender != self._other:
            return b""
        self._other = sender
        return data

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


class SerialLink:
    """A serial line, by pyserial (extra ``rig``)."""

    def __init__(self, path: str, baud: int) -> None:
        try:
            import serial  # noqa: PLC0415  (an extra)
        except ImportError as error:
            raise ValueError(
                f"rig: {path} is a serial line, which needs pyserial. Install it with: pip install 'flexdrive[rig]'"
            ) from error
        self.name = f"serial://{path}?baud={baud}"
        self.baud = baud
        self._broken: tuple[type[Exception], ...] = (serial.SerialException, OSError)
        try:
            self._port = serial.Serial(path, baud, timeout=0.0, write_timeout=0.1, exclusive=os.name == "posix" or None)
        except (serial.SerialException, ValueError) as error:
            raise RigStopped("lost peer", f"{path} cannot be opened ({error}). Name the line of the rig.") from error

    def send(self, data: bytes) -> None:
        """Send bytes.

        Raises
        ------
        RigStopped
            If the line is gone.
        """
        try:
            self._port.write(data)
        except self._broken as error:
            raise RigStopped("lost peer", f"{self.name} is gone ({error}).") from error

    def receive(self, timeout: float) -> bytes:
        """Return the bytes that came.

        Raises
        ------
        RigStopped
            If the line is gone.
        """
        try:
            self._port.timeout = max(timeout, 0.0)
            first: bytes = self._port.read(1)
            more: bytes = self._port.read(self._port.in_waiting) if first else b""
        except self._broken as error:
            raise RigStopped("lost peer", f"{self.name} is gone ({error}).") from error
        return first + more

    def close(self) -> None:
        """Close the line."""
        self._port.close()


class PtyLink:
    """A rig's end of a pseudo-terminal, whose other end looks like a serial line; POSIX only."""

    def __init__(self) -> None:
        self._own, other = os.openpty()
        import tty  # noqa: PLC0415  (not on Windows)

        tty.setraw(other)
        self._kept = other  # else reading fails until somebody opens it
        self.name = os.ttyname(other)

    def send(self, data: bytes) -> None:
        """Send bytes; where nobody reads, they are lost."""
        if select.select([], [self._own], [], 0.0)[1]:
            os.write(self._own, data)

    def receive(self, timeout: float) -> bytes:
        """Return the bytes that came."""
        return os.read(self._own, _MOST_BYTES) if _readable(self._own, timeout) else b""

    def close(self) -> None:
        """Close both ends."""
        os.close(self._own)
        os.close(self._kept)

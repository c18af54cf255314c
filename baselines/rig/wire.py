"""The frames between this program and a rig, version 1; ``docs/rig.md`` is their description for other programs.

A frame is a head, a payload whose length its kind fixes, and a checksum, all little-endian: magic ``FD``, version, kind,
sequence number, time stamp [µs], payload, CRC-32 of everything before it. Over UDP a datagram is a frame; on a serial line frames
follow one another, and :class:`Scanner` finds its way back after lost or damaged bytes.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
from zlib import crc32

from baselines.rig.protocol import MOST_NAME, Description, Limits

VERSION = 1
MAGIC = b"FD"
_HEAD, _SUM = struct.Struct("<2sBBII"), struct.Struct("<I")


class Kind(IntEnum):
    """What a frame says; the first four go to the rig."""

    HELLO = 1
    START = 2
    COMMAND = 3
    STOP = 4
    DESCRIPTION = 5
    READING = 6
    STOPPED = 7


class Reason(IntEnum):
    """Why a rig stopped."""

    ASKED = 0
    WATCHDOG = 1
    TRAVEL = 2


_PAYLOADS = {
    Kind.HELLO: struct.Struct("<"),
    Kind.START: struct.Struct("<I"),  # watchdog [µs]
    Kind.COMMAND: struct.Struct("<f"),  # u [V]
    Kind.STOP: struct.Struct("<"),
    # period, watchdog [µs]; travel [mm], voltage [V]; mm per count, twice; carts, real time; name
    Kind.DESCRIPTION: struct.Struct(f"<IIffddBB{MOST_NAME}s"),
    Kind.READING: struct.Struct("<iifI"),  # counts, twice; u put out [V]; latency [µs]
    Kind.STOPPED: struct.Struct("<B"),  # reason
}
SIZES = {kind: _HEAD.size + payload.size + _SUM.size for kind, payload in _PAYLOADS.items()}
NO_LATENCY = 2**32 - 1


@dataclass(frozen=True, slots=True)
class Frame:
    """A frame without its armour.

    Attributes
    ----------
    kind
    sequence
        Of the sample that a reading or a command is about.
    time_us
        Of the sender's clock, since the run's first sample [µs].
    values
        The payload, in the order of :mod:`baselines.rig.wire`.
    """

    kind: Kind
    sequence: int = 0
    time_us: int = 0
    values: tuple[int | float | bytes, ...] = ()

    def pack(self) -> bytes:
        """Return the bytes that travel."""
        head = _HEAD.pack(MAGIC, VERSION, self.kind, self.sequence & 0xFFFFFFFF, self.time_us & 0xFFFFFFFF)
        body = head + _PAYLOADS[self.kind].pack(*self.values)
        return body + _SUM.pack(crc32(body))


class Scanner:
    """Finds frames in bytes as they come.

    Attributes
    ----------
    damaged
        Bytes that belonged to no frame.
    other_version
        Version of the last frame that was of another one, if any.
    """

    def __init__(self) -> None:
        self._bytes = bytearray()
        self.damaged = 0
        self.other_version: int | None = None

    def feed(self, data: bytes) -> Iterator[Frame]:
        """Yield the frames that are whole now."""
        self._bytes += data
        while True:
            begin = self._bytes.find(MAGIC)
            skipped = begin if begin >= 0 else max(len(self._bytes) - 1, 0)
            self.damaged += skipped
            del self._bytes[:skipped]
            if begin < 0 or len(self._bytes) < _HEAD.size:
                return
            _magic, version, kind, sequence, time_us = _HEAD.unpack_from(self._bytes)
            if version != VERSION or kind not in SIZES:
                self.other_version = version if version != VERSION else self.other_version
                self._skip()
                continue
            size = SIZES[Kind(kind)]
            if len(self._bytes) < size:
                return
            body = bytes(self._bytes[: size - _SUM.size])
            if _SUM.unpack_from(self._bytes, size - _SUM.size)[0] != crc32(body):
                self._skip()
                continue
            del self._bytes[:size]
            yield Frame(Kind(kind), sequence, time_us, _PAYLOADS[Kind(kind)].unpack_from(body, _HEAD.size))

    def _skip(self) -> None:
        """Look for the next beginning behind one that led to no frame."""
        self.damaged += len(MAGIC)
        del self._bytes[: len(MAGIC)]


def described(rig: Description) -> Frame:
    """Return the frame in which a rig describes itself."""
    name = rig.name.encode()[:MOST_NAME].decode(errors="ignore").encode()
    limits = rig.limits
    return Frame(
        Kind.DESCRIPTION,
        values=(
            micro(rig.period),
            micro(limits.watchdog),
            limits.travel,
            limits.voltage,
            *rig.quantum,
            rig.carts,
            rig.real_time,
            name,
        ),
    )


def description(frame: Frame) -> Description:
    """Return what a rig says of itself in such a frame.

    Raises
    ------
    ValueError
        If a value is none of a rig.
    """
    period, watchdog, travel, voltage, quantum_1, quantum_2, carts, real_time, name = frame.values
    said = Description(
        name=bytes(name).rstrip(b"\0").decode(errors="replace"),  # type: ignore[arg-type]
        period=float(period) / 1e6,
        carts=int(carts),
        quantum=(float(quantum_1), float(quantum_2)),
        limits=Limits(travel=float(travel), voltage=float(voltage), watchdog=float(watchdog) / 1e6),
        real_time=bool(real_time),
    )
    if said.carts not in (1, 2) or not said.period > 0.0 or not all(0.0 < q < 1e3 for q in said.quantum[: said.carts]):
        raise ValueError(
            f"rig: must have a positive period, 1 or 2 carts and positive lengths of a count; it says {said}. Correct its "
            "description."
        )
    return said


def micro(seconds: float) -> int:
    """Return a time in whole µs, as long as fits."""
    return int(min(round(1e6 * seconds), 0xFFFFFFFF))

"""The format is what docs/rig.md says: an independent packing gives the same bytes, and damage is noticed."""

import binascii
import re
import struct
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from baselines.rig.protocol import Description, Limits
from baselines.rig.wire import SIZES, Frame, Kind, Scanner, described, description
from tests.each import each

READING = Frame(Kind.READING, 7, 7000, (-1234, 5678, 1.5, 90))


def test_a_reading_is_packed_as_documented():
    body = struct.pack("<2sBBIIiifI", b"FD", 1, 6, 7, 7000, -1234, 5678, 1.5, 90)
    assert READING.pack() == body + struct.pack("<I", binascii.crc32(body))
    page = (Path(__file__).parents[3] / "docs" / "rig.md").read_text(encoding="utf-8")
    assert READING.pack().hex() in re.sub(r"\s", "", page)
    for kind, size in SIZES.items():
        assert re.search(rf"\| {kind.value} \| {kind.name} \|.*\| {size} \|", page), kind


def test_a_description_comes_back():
    told = Description("a rig of ü", 1e-3, 2, (0.0046592, 0.005), Limits(250.0, 8.0, watchdog=0.05))
    found = description(next(Scanner().feed(described(told).pack())))
    assert found == told
    long = Description("ü" * 40, 1e-3, 1, (0.01, 0.0), Limits(250.0, 8.0), real_time=False)
    assert description(next(Scanner().feed(described(long).pack()))).name == "ü" * 16
    with pytest.raises(ValueError, match="positive lengths of a count"):
        description(next(Scanner().feed(described(Description("", 1e-3, 2, (0.1, 0.0), Limits(1.0, 1.0))).pack())))


@settings(deadline=None)
@given(noise=st.binary(max_size=60), cuts=st.lists(st.integers(1, 40), max_size=8))
def test_frames_are_found_in_a_stream_cut_anywhere(noise, cuts):
    stream = noise + b"\0" + 3 * READING.pack()
    scanner, found = Scanner(), []
    for size in cuts:
        found += scanner.feed(stream[:size])
        stream = stream[size:]
    found += scanner.feed(stream)
    # noise that happens to be a head may wait for a longer frame, and swallow none but by its checksum
    found += scanner.feed(bytes(100))
    assert found[-3:] == 3 * [READING]


@each("place", range(SIZES[Kind.READING]))
def test_no_damaged_byte_passes(place):
    data = bytearray(READING.pack())
    data[place] ^= 0x10
    assert [f for f in Scanner().feed(bytes(data) + bytes(100)) if f.kind is Kind.READING] == []
    assert list(Scanner().feed(bytes(data) + bytes(100) + READING.pack()))[-1] == READING


def test_another_version_is_told_from_noise():
    scanner = Scanner()
    data = bytearray(READING.pack())
    data[2] = 2
    assert list(scanner.feed(bytes(data))) == []
    assert scanner.other_version == 2

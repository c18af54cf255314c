"""Whether a ``.mat`` file of version 4 to 7.2 can hold what its headers declare.

A damaged header may declare gigabytes, which a reader would allocate, or a type that no version knows. Each element is
followed from tag to tag before :mod:`scipy.io` loads the file.
"""

from __future__ import annotations

import struct
import zlib

from identification.recordings.table import LARGEST

_BYTES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8, 16: 1, 17: 2, 18: 4}  # of one value, by type
_MATRIX, _COMPRESSED = 14, 15
_CELL, _STRUCT, _OBJECT, _CHAR, _SPARSE, _FUNCTION, _OPAQUE = 1, 2, 3, 4, 5, 16, 17
_NUMERIC = range(6, 16)
_V4_BYTES = (8, 4, 4, 2, 2, 1)
DEEPEST = 32  # structs and cells within each other


def check_sizes(data: bytes) -> None:
    """Check the declared sizes of a file.

    Parameters
    ----------
    data
        The whole file.

    Raises
    ------
    ValueError
        If an element is longer than the file, holds fewer values than its dimensions say, or is of no known type.
    """
    if len(data) >= 4 and 0 in data[:4]:
        _check_4(data)
    else:
        _check_5(data)


def _check_4(data: bytes) -> None:
    place = 0
    order = "<" if 0 <= struct.unpack_from("<i", data)[0] < 5000 else ">"
    while place < len(data):
        if place + 20 > len(data):
            raise ValueError(f"header of a variable cut off at byte {place}")
        kind, rows, columns, imaginary, length = struct.unpack_from(f"{order}5i", data, place)
        digit = kind // 10 % 10
        if not 0 <= kind < 5000 or digit >= len(_V4_BYTES) or kind % 10 > 2 or min(rows, columns) < 0 or length < 0:
            raise ValueError(f"header of a variable at byte {place} is none of version 4")
        size = rows * columns * _V4_BYTES[digit] * (2 if imaginary == 1 else 1)
        place += 20 + length + size
        if place > len(data):
            raise ValueError(f"a variable of {rows} × {columns} values in a file of {len(data)} bytes")


def _check_5(data: bytes) -> None:
    if len(data) < 128 or data[126:128] not in (b"IM", b"MI"):
        raise ValueError("no header of a MATLAB file")
    order = "<" if data[126:128] == b"IM" else ">"
    left = LARGEST
    place = 128
    while place + 8 <= len(data):
        kind, size = struct.unpack_from(f"{order}2I", data, place)
        end = place + 8 + size
        if end > len(data):
            raise ValueError(f"an element of {size} bytes at byte {place} in a file of {len(data)}")
        if kind == _COMPRESSED:
            inside = _unpacked(data[place + 8 : end], left)
            left -= len(inside)
            if len(inside) < 8:
                raise ValueError(f"an empty element at byte {place}")
            kind, size = struct.unpack_from(f"{order}2I", inside)
            if kind != _MATRIX or 8 + size > len(inside):
                raise ValueError(f"an element of type {kind} and {size} bytes at byte {place}")
            _check_matrix(inside, 8, 8 + size, order, 0)
        elif kind == _MATRIX:
            _check_matrix(data, place + 8, end, order, 0)
        else:
            raise ValueError(f"an element of type {kind} at byte {place}")
        place = end


def _unpacked(data: bytes, limit: int) -> bytes:
    machine = zlib.decompressobj()
    inside = machine.decompress(data, limit + 1)
    if len(inside) > limit:
        raise ValueError(f"more than {LARGEST >> 20} MB of numbers")
    return inside


def _element(data: bytes, place: int, end: int, order: str) -> tuple[int, int, int, int]:
    """Return type, first byte, last byte and the place of the next of an element."""
    if place + 8 > end:
        raise ValueError(f"an element cut off at byte {place}")
    kind, size = struct.unpack_from(f"{order}2I", data, place)
    if kind >> 16:  # up to four bytes stand in the tag
        size, kind = kind >> 16, kind & 0xFFFF
        if size > 4:
            raise ValueError(f"a short element of {size} bytes at byte {place}")
        return kind, place + 4, place + 4 + size, place + 8
    first = place + 8
    if first + size > end:
        raise ValueError(f"an element of {size} bytes at byte {place}")
    step = size if kind == _MATRIX else -(-size // 8) * 8
    return kind, first, first + size, min(first + step, end)


def _values(data: bytes, place: int, end: int, order: str, count: int | None = None) -> tuple[bytes, int]:
    """Return the bytes of a plain element and the place of the next, after checking that it has so many values."""
    kind, first, last, following = _element(data, place, end, order)
    if kind not in _BYTES:
        raise ValueError(f"a value of type {kind} at byte {place}")
    if count is not None and (last - first) // _BYTES[kind] < count:
        raise ValueError(f"{(last - first) // _BYTES[kind]} values of {count} at byte {place}")
    return data[first:last], following


def _check_matrix(data: bytes, place: int, end: int, order: str, depth: int) -> None:
    if place == end:
        return  # an empty array
    if depth > DEEPEST:
        raise ValueError(f"more than {DEEPEST} structs within each other")
    flags, place = _values(data, place, end, order)
    if len(flags) < 8:
        raise ValueError(f"flags of {len(flags)} bytes at byte {place}")
    word = struct.unpack(f"{order}I", flags[:4])[0]
    kind, imaginary = word & 0xFF, bool(word & 0x800)
    if kind == _OPAQUE:
        for _ in range(3):
            _, place = _values(data, place, end, order)
        _inner(data, place, end, order, depth)
        return
    raw, place = _values(data, place, end, order)
    count = 1
    if len(raw) % 4 or not 8 <= len(raw) <= 128:
        raise ValueError(f"{len(raw)} bytes of dimensions at byte {place}")
    for number in struct.unpack(f"{order}{len(raw) // 4}i", raw):
        if number < 0:
            raise ValueError(f"a dimension of {number} at byte {place}")
        count *= number
    _, place = _values(data, place, end, order)  # its name
    if kind in _NUMERIC:
        for _ in range(2 if imaginary else 1):
            _, place = _values(data, place, end, order, count)
    elif kind == _CHAR:
        _values(data, place, end, order, count)
    elif kind == _SPARSE:
        for _ in range(4 if imaginary else 3):
            _, place = _values(data, place, end, order)
    elif kind == _FUNCTION:
        _inner(data, place, end, order, depth)
    elif kind in (_CELL, _STRUCT, _OBJECT):
        _check_container(data, place, end, order, depth, kind, count)
    else:
        raise ValueError(f"an array of class {kind} at byte {place}")


def _check_container(data: bytes, place: int, end: int, order: str, depth: int, kind: int, count: int) -> None:
    fields = 1
    if kind != _CELL:
        if kind == _OBJECT:
            _, place = _values(data, place, end, order)
        raw, place = _values(data, place, end, order)
        width = struct.unpack(f"{order}i", raw[:4])[0] if len(raw) >= 4 else 0
        names, place = _values(data, place, end, order)
        if names and width <= 0:
            raise ValueError(f"names of {width} letters at byte {place}")
        fields = len(names) // width if names else 0
    if count * fields > (end - place) // 8 or (fields == 0 and count > 1 << 16):
        raise ValueError(f"{count} × {fields} entries at byte {place}")
    for _ in range(count * fields):
        place = _inner(data, place, end, order, depth)


def _inner(data: bytes, place: int, end: int, order: str, depth: int) -> int:
    """Check an array within an array and return the place behind it."""
    kind, first, last, following = _element(data, place, end, order)
    if kind != _MATRIX:
        raise ValueError(f"an entry of type {kind} at byte {place}")
    _check_matrix(data, first, last, order, depth + 1)
    return following

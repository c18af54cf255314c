"""Files that a visitor brings: bounded in size, number, names and what compressed ones hold."""

from __future__ import annotations

import os
import tempfile
import zlib
from collections.abc import AsyncIterator
from pathlib import Path, PurePosixPath

from baselines.lab_page import texts
from identification.recordings.files import EXTENSIONS as RECORDED

LARGEST_FILE = 64_000_000
LARGEST_UNPACKED = 200_000_000
LARGEST_SUM = 400_000_000
MOST_FILES = 400
# recordings, and what describes a rig or a drive
EXTENSIONS = (*RECORDED, ".toml")
_DEEPEST, _LONGEST = 8, 120


class RefusedError(ValueError):
    """A file that is not taken; the message is for the visitor."""


def safe_path(name: str) -> PurePosixPath:
    """Return a file's path below the visitor's folder.

    Parameters
    ----------
    name
        As the browser says it: a name, or a path within the folder that was dropped.

    Raises
    ------
    RefusedError
        For a path that leads elsewhere, a name that no file system likes, or an extension that is no recording's.
    """
    shown = name[-60:]
    parts = PurePosixPath(name.replace("\\", "/")).parts
    wrong = not parts or len(parts) > _DEEPEST or name.startswith("/")
    if wrong or any(p in {"..", "."} or len(p) > _LONGEST or not p.isprintable() or ":" in p for p in parts):
        raise RefusedError(texts.UPLOAD_FAILED.format(name=shown, reason=texts.BAD_NAME))
    if not parts[-1].lower().endswith(EXTENSIONS):
        raise RefusedError(texts.WRONG_KIND.format(name=shown, kinds=", ".join(EXTENSIONS)))
    return PurePosixPath(*parts)


async def take(
    folder: Path, name: str, body: AsyncIterator[bytes], largest: int = LARGEST_FILE, most: int = LARGEST_UNPACKED
) -> Path:
    """Write one file into a visitor's folder, whole or not at all.

    Parameters
    ----------
    folder
        Of the visitor's recordings.
    name
        As the browser says it.
    body
        The content, piece by piece.
    largest, most
        Of the file and of what it holds unpacked [bytes].

    Raises
    ------
    RefusedError
        For a name, a number, a size or an unpacked size beyond what is taken.
    """
    path = safe_path(name)
    room = min(largest, _room(folder))
    temporary = _open(folder)
    try:
        with temporary.open("wb") as stream:
            unpack = zlib.decompressobj(31) if path.name.lower().endswith(".gz") else None
            size, unpacked = 0, 0
            async for piece in body:
                size += len(piece)
                unpacked += _unpacked(unpack, piece, most)
                _require(size <= room and unpacked <= most, path.name, largest)
                stream.write(piece)
        return _keep(temporary, folder / path)
    except BaseException:
        _drop(temporary)
        raise


def _room(folder: Path) -> int:
    """Return how many bytes a visitor may still bring."""
    there = [p for p in folder.rglob("*") if p.is_file()] if folder.is_dir() else []
    if len(there) >= MOST_FILES:
        raise RefusedError(texts.TOO_MANY.format(most=MOST_FILES))
    return LARGEST_SUM - sum(p.stat().st_size for p in there)


def _open(folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=folder, prefix=".incoming.")
    os.close(handle)
    return Path(name)


def _require(fits: bool, name: str, largest: int) -> None:
    if not fits:
        raise RefusedError(texts.TOO_LARGE.format(name=name, most=largest // 1_000_000))


def _keep(temporary: Path, target: Path) -> Path:
    target.parent.mkdir(parents=True, exist_ok=True)
    return temporary.replace(target)


def _drop(temporary: Path) -> None:
    temporary.unlink(missing_ok=True)


def _unpacked(unpack: zlib._Decompress | None, piece: bytes, most: int) -> int:
    """Return how many bytes a piece of a compressed file holds, at most a little more than is taken; 0 where it is broken."""
    if unpack is None or unpack.eof:
        return 0
    try:
        total, rest = 0, piece
        while rest and total <= most:
            total += len(unpack.decompress(rest, 1_000_000))
            rest = unpack.unconsumed_tail
    except zlib.error:  # the reader says so, with the file's name
        return 0
    return total

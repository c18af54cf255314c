"""Writing files so that nothing is ever half-written, nothing but a file is ever replaced, and no two runs write at once."""

from __future__ import annotations

import os
import shutil
import stat
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

LOCK = ".flexdrive.lock"


def writable_file(path: str | Path) -> Path:
    """Return where a file is to be written: the end of its symbolic links, a regular file or nothing yet.

    Parameters
    ----------
    path
        As the user gave it. A link is followed: what it points to is written, and the link stays.

    Raises
    ------
    ValueError
        If there is a device, a pipe, a folder or anything else that is no regular file, or no folder in which a file can be made.
    """
    given = Path(path)
    try:
        target = given.resolve()
    except (OSError, RuntimeError) as error:  # links that go round in a circle
        raise ValueError(f"output: {given} cannot be followed ({_reason(error)}). Choose another file.") from error
    named = f"{given}" if target == given.absolute() else f"{given}, which is {target},"
    try:
        kind = target.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        _writable_folder(target.parent, given)
        return target
    except OSError as error:
        raise ValueError(f"output: {named} cannot be written ({_reason(error)}). Choose another file.") from error
    if not stat.S_ISREG(kind):
        raise ValueError(f"output: only a regular file is replaced; {named} is {_kind(kind)}. Choose another file.")
    _writable_folder(target.parent, given)
    return target


def _writable_folder(folder: Path, asked: Path) -> None:
    """Refuse a folder in which no file can be made, there or to be made."""
    there = next(f for f in (folder, *folder.parents) if f.exists())
    if not there.is_dir():
        raise ValueError(f"output: {asked} cannot be written: {there} is a file, no folder. Choose another place.")
    try:
        # os.access knows nothing of /proc and of full or read-only file systems; a file that is made and gone does
        tempfile.TemporaryFile(dir=there).close()
    except OSError as error:
        raise ValueError(
            f"output: {asked} cannot be written: no file can be made in {there} ({_reason(error)}). Choose another place."
        ) from error


def _reason(error: Exception) -> str:
    return (getattr(error, "strerror", None) or str(error)).lower()


def _kind(mode: int) -> str:
    kinds = (
        (stat.S_ISDIR, "a folder"),
        (stat.S_ISCHR, "a device"),
        (stat.S_ISBLK, "a device"),
        (stat.S_ISFIFO, "a pipe"),
    )
    return next((name for test, name in kinds if test(mode)), "no file")


@contextmanager
def only_writer(folder: str | Path) -> Iterator[Path]:
    """Hold a folder's lock while a run writes into it, so that a second run is refused instead of mixing its files in.

    The lock is the operating system's, so a run that was killed holds none. Its file goes at the end, and so does a folder
    that stayed empty.

    Parameters
    ----------
    folder
        Target; it and its parents are made.

    Yields
    ------
    pathlib.Path
        The folder, links followed.

    Raises
    ------
    ValueError
        If another run holds the lock, or the folder cannot be written.
    """
    from filelock import FileLock, Timeout  # noqa: PLC0415  (slow to import)

    target = writable_folder(folder)
    made = [f for f in (target, *target.parents) if not f.exists()]
    target.mkdir(parents=True, exist_ok=True)
    lock = FileLock(target / LOCK, timeout=0)
    try:
        lock.acquire()
    except Timeout:
        raise ValueError(
            f"output: another run of flexdrive is writing into {folder}; its lock is {target / LOCK}. Wait until it has ended, "
            "or choose another folder."
        ) from None
    try:
        yield target
    finally:
        # before the release: whoever opened this file meanwhile finds that it is gone, and makes one of its own
        (target / LOCK).unlink(missing_ok=True)
        lock.release()
        with suppress(OSError):
            for empty in made:
                empty.rmdir()


def writable_folder(path: str | Path) -> Path:
    """Return where a folder is to be written, links followed.

    Raises
    ------
    ValueError
        If there is something else, or no file can be made there.
    """
    given = Path(path)
    try:
        target = given.resolve()
    except (OSError, RuntimeError) as error:
        raise ValueError(f"output: {given} cannot be followed ({_reason(error)}). Choose another folder.") from error
    if target.exists() and not target.is_dir():
        raise ValueError(f"output: must be a folder; {given} is none. Choose another folder.")
    _writable_folder(target, given)
    return target


def write_atomically(path: str | Path, content: str | bytes) -> Path:
    """Write a file by way of a temporary neighbour and a rename.

    Parameters
    ----------
    path
        Target; parent directories are made. A symbolic link stays, and what it points to is replaced.
    content
        Text (written as UTF-8) or bytes.

    Returns
    -------
    pathlib.Path
        As given.

    Raises
    ------
    ValueError
        If the target is no regular file, or cannot be written.
    """
    target = writable_file(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    data = content.encode() if isinstance(content, str) else content
    handle, temporary = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.")
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(data)
        _like_any_other(Path(temporary))
        Path(temporary).replace(target)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
    return Path(path)


def write_together(folder: Path, write: Callable[[Path], None], *, stale: str | None = None) -> None:
    """Write files into a temporary neighbour of a folder, then rename every one: what fails leaves the folder as it was.

    Parameters
    ----------
    folder
        Target; it and its parents are made.
    write
        Writes the files, without folders, into the folder it is given.
    stale
        Pattern of files of an earlier run, which go once the new ones are there to replace them.
    """
    folder = writable_folder(folder)
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix=f".{folder.name}.") as name:
        temporary = Path(name)
        write(temporary)
        folder.mkdir(exist_ok=True)
        # every target is looked at before the first is replaced
        targets = {file: writable_file(folder / file.name) for file in sorted(temporary.iterdir())}
        for old in folder.glob(stale) if stale is not None else ():
            old.unlink()
        for file, target in targets.items():
            _like_any_other(file)
            # a folder may be a mount of its own, which no rename reaches
            shutil.move(file, target)


def _like_any_other(file: Path) -> None:
    """Give a temporary, private file the permissions that any other new file would get."""
    umask = os.umask(0)
    os.umask(umask)
    file.chmod(0o666 & ~umask)

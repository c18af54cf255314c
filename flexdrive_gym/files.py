"""Writing files so that nothing is ever half-written."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path


def write_atomically(path: str | Path, content: str | bytes) -> Path:
    """Write a file by way of a temporary neighbour and a rename.

    Parameters
    ----------
    path
        Target; parent directories are made.
    content
        Text (written as UTF-8) or bytes.

    Returns
    -------
    pathlib.Path
    """
    target = Path(path)
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
    return target


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
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix=f".{folder.name}.") as name:
        temporary = Path(name)
        write(temporary)
        folder.mkdir(exist_ok=True)
        for old in folder.glob(stale) if stale is not None else ():
            old.unlink()
        for file in sorted(temporary.iterdir()):
            _like_any_other(file)
            # a folder may be a mount of its own, which no rename reaches
            shutil.move(file, folder / file.name)


def _like_any_other(file: Path) -> None:
    """Give a temporary, private file the permissions that any other new file would get."""
    umask = os.umask(0)
    os.umask(umask)
    file.chmod(0o666 & ~umask)

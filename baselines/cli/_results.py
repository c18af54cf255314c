"""Where commands write: found out before anything is computed, one run at a time, over nothing finished without ``--force``."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

Force = Annotated[bool, typer.Option("--force", help="Overwrite a finished result.")]
_RECORDINGS = (".csv", ".gz", ".mat")


@contextmanager
def result_folder(folder: Path, finished: str, *, force: bool = False) -> Iterator[None]:
    """Hold a folder while a run writes its result there.

    Parameters
    ----------
    folder
        Target.
    finished
        File whose presence says that the folder holds a finished result.
    force
        Overwrite it.

    Raises
    ------
    ValueError
        If there is a finished result, another run is writing, or nothing can be written there.
    """
    from flexdrive_gym.files import only_writer  # noqa: PLC0415  (imports numpy)

    require_unfinished(folder, finished, force=force)
    with only_writer(folder):
        yield


def require_unfinished(folder: Path, finished: str, *, force: bool) -> None:
    """Refuse to write over a finished result, unless that was asked for."""
    if not force and (folder / finished).exists():
        raise ValueError(
            f"output: {folder} holds a finished result, {finished}. Choose another folder with -o, or overwrite it with --force."
        )


def require_no_recordings(folder: Path, *, force: bool) -> None:
    """Refuse to write recordings among others, which could be a rig's and the only ones there are."""
    if not force and folder.is_dir() and any(p.suffix in _RECORDINGS for p in folder.iterdir()):
        raise ValueError(
            f"output: {folder} holds recordings, and new ones could replace them. Choose another folder with -o, or write among "
            "them with --force."
        )


def result_file(path: Path) -> Path:
    """Return where a command writes its one file, found to be writable before anything is computed.

    Raises
    ------
    ValueError
        If it is no regular file, a recording, or cannot be written.
    """
    from flexdrive_gym.files import writable_file  # noqa: PLC0415

    if path.suffix in _RECORDINGS and path.exists():
        raise ValueError(
            f"output: {path} is a recording by its name, and recordings are not overwritten. Choose another file."
        )
    writable_file(path)
    return path


@contextmanager
def interrupted_says(tell: Callable[[], str]) -> Iterator[None]:
    """Say after Ctrl-C what is kept and how to go on."""
    try:
        yield
    except KeyboardInterrupt:
        print(f"flexdrive: interrupted; {tell()}", file=sys.stderr)
        raise SystemExit(1) from None

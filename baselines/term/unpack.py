"""Archives of hand-ins, unpacked so that nothing in them can reach out of its folder, fill the disk or take for ever.

What an entry's header says of its size is not believed: bytes are counted as they come. Archives within archives share one
budget. Only files that may be recordings, a ``rig.toml`` and further archives are written; links are left out.
"""

from __future__ import annotations

import shutil
import stat
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import IO

from identification.recordings.files import EXTENSIONS, extension

RIG_FILE = "rig.toml"
ARCHIVES = (".zip",)
# a hand-in of twenty recordings has 5 MB of text; these stop what was not made to be read
MOST_BYTES, MOST_FILES, MOST_DEPTH = 1 << 30, 5_000, 3
_CHUNK = 1 << 20


class HandInError(ValueError):
    """An archive that is not unpacked, with the reason and a remedy."""


@dataclass
class Budget:
    """What may still be unpacked of one hand-in: bytes and files."""

    size: int = MOST_BYTES
    files: int = MOST_FILES

    def take(self, size: int) -> None:
        """Count bytes that were unpacked.

        Raises
        ------
        HandInError
            If there are more than may be.
        """
        self.size -= size
        if self.size < 0:
            raise HandInError(
                f"archive: must unpack to at most {MOST_BYTES >> 20} MB in all; got more. Hand in the recordings alone."
            )

    def take_file(self) -> None:
        """Count a file; raises as :meth:`take`."""
        self.files -= 1
        if self.files < 0:
            raise HandInError(
                f"archive: must hold at most {MOST_FILES} files in all; got more. Hand in the recordings alone."
            )


def of_use(path: PurePosixPath) -> bool:
    """Whether a file of a hand-in is read: a recording by its name, a rig description or an archive, and not hidden."""
    if any(part.startswith(".") or part == "__MACOSX" for part in path.parts):
        return False
    return path.name == RIG_FILE or extension(Path(path.name)) in EXTENSIONS or is_archive(path)


def is_archive(path: PurePosixPath | Path) -> bool:
    """Whether a file is an archive by its name."""
    return path.suffix.lower() in ARCHIVES


def unpack(archive: Path, target: Path, budget: Budget, depth: int = 1) -> list[tuple[str, str]]:
    """Unpack an archive and the archives within it.

    Parameters
    ----------
    archive
        A ``.zip``.
    target
        Folder to unpack into; it is made.
    budget
        Of the whole hand-in; counted down.
    depth
        1 for an archive that is no other's entry.

    Returns
    -------
    list of (str, str)
        Archives within it that were left out, each with its reason.

    Raises
    ------
    HandInError
        If it is damaged, encrypted, unsafe or too large.
    """
    if depth > MOST_DEPTH:
        raise HandInError(f"archive: archives must lie at most {MOST_DEPTH} deep in one another; got more. Unpack it.")
    refused: list[tuple[str, str]] = []
    try:
        with zipfile.ZipFile(archive) as opened:
            # every name is looked at before the first file is written
            entries = [(entry, _safe(entry)) for entry in opened.infolist() if not entry.is_dir()]
            for entry, path in entries:
                if stat.S_ISLNK(entry.external_attr >> 16) or not of_use(path):
                    continue
                budget.take_file()
                file = target / path
                file.parent.mkdir(parents=True, exist_ok=True)
                with opened.open(entry) as source, file.open("wb") as sink:
                    _copy(source, sink, budget)
                if is_archive(path):
                    refused += unpacked_in_place(file, path.as_posix(), budget, depth + 1)
    except HandInError:
        raise
    except RuntimeError as error:  # zipfile's word for a password
        raise HandInError(
            f"archive: must not be encrypted; got {_short(error)}. Hand it in without a password."
        ) from error
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, OSError, ValueError) as error:
        raise HandInError(
            f"archive: must be a complete zip archive; got {_short(error)}. Make it again, or hand in the folder."
        ) from error
    return refused


def unpacked_in_place(file: Path, name: str, budget: Budget, depth: int = 1) -> list[tuple[str, str]]:
    """Replace an archive by a folder of its name; return what was left out, which may be the archive itself."""
    target = file.with_name(file.name + ".unpacked")
    try:
        inner = unpack(file, target, budget, depth)
    except HandInError as error:
        # what is unsafe in part is left out whole
        shutil.rmtree(target, ignore_errors=True)
        return [(name, str(error))]
    finally:
        file.unlink()
    if target.exists() and not file.with_suffix("").exists():
        target.rename(file.with_suffix(""))
    return [(f"{name}/{path}", reason) for path, reason in inner]


def _safe(entry: zipfile.ZipInfo) -> PurePosixPath:
    """Return the path of an entry within its folder; Windows' separators count as such."""
    path = PurePosixPath(entry.filename.replace("\\", "/"))
    if path.is_absolute() or ".." in path.parts or any(":" in part or "\0" in part for part in path.parts):
        raise HandInError(
            f"archive: every entry must stay within the archive's folder; got {entry.filename!r}. Pack the folder again."
        )
    return path


def _copy(source: IO[bytes], sink: IO[bytes], budget: Budget) -> None:
    while chunk := source.read(_CHUNK):
        budget.take(len(chunk))
        sink.write(chunk)


def _short(error: Exception) -> str:
    return " ".join(f"{error}".split())[:120] or type(error).__name__

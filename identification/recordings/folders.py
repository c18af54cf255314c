"""Which files of a folder may be recordings, and what each is called."""

from __future__ import annotations

import difflib
from collections import Counter
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING

from identification.recordings.errors import broken
from identification.recordings.files import EXTENSIONS, NOT_READ, extension

if TYPE_CHECKING:
    from collections.abc import Sequence

    from identification.recordings.errors import RecordingError


def wanted(path: Path, only: Sequence[str], skip: Sequence[str]) -> bool:
    """Whether a path from the folder down is asked for: it matches ``only``, if given, and not ``skip``."""

    def matches(patterns: Sequence[str]) -> bool:
        return any(fnmatchcase(text, pattern) for pattern in patterns for text in (path.as_posix(), path.name))

    return (not only or matches(only)) and not matches(skip)


def collect(paths: list[str | Path]) -> list[tuple[Path, Path | None]]:
    """Return each file once, with the folder it was found in, or ``None`` if it was named itself."""
    found: dict[Path, tuple[Path, Path | None]] = {}
    if not paths:
        raise broken("recordings", "paths", "at least one file or folder is needed", "none", "Name one.")
    for item in paths:
        path = Path(item)
        if path.is_dir():
            for file in _folder(path):
                found.setdefault(file.resolve(), (file, path))
        elif path.exists():
            found[path.resolve()] = (path, None)
        else:
            raise _missing(path)
    return list(found.values())


def _folder(folder: Path) -> list[Path]:
    """Return the files of a folder that may be recordings, hidden ones aside."""
    # the description is no recording, and neither are hidden files
    every = sorted(path for path in folder.rglob("*") if path.is_file())
    visible = [p for p in every if not any(part.startswith(".") for part in p.relative_to(folder).parts)]
    # what a spreadsheet holds open beside itself is none
    files = [p for p in visible if extension(p) in (*EXTENSIONS, *NOT_READ) and not p.name.startswith("~$")]
    if not files:
        other = ", ".join(path.name for path in visible[:5]) or "nothing"
        raise broken(
            str(folder),
            "folder",
            f"must contain {', '.join(kind for kind in EXTENSIONS if not kind.endswith('.gz'))} files",
            other,
            "Export the logs as .csv with a header line such as t_s,u_V,v1_mm_s,v2_mm_s.",
        )
    return files


def _missing(path: Path) -> RecordingError:
    parent = path.parent
    siblings = [item.name for item in parent.iterdir()] if parent.is_dir() else []
    near = difflib.get_close_matches(path.name, siblings, n=1, cutoff=0.6)
    remedy = f"Did you mean {near[0]}?" if near else "Check the spelling and the working directory."
    return broken(str(path), "path", "must exist", "no such file or folder", remedy)


def _stem(path: Path) -> str:
    return path.name[: len(path.name) - len(extension(path))] or path.name


def short_names(files: list[Path]) -> list[str]:
    """Return short names, with as many folders in front as it takes to tell equal ones apart."""
    names = [_stem(path) for path in files]
    parts = [path.resolve().parts for path in files]
    for depth in range(1, max((len(p) for p in parts), default=1)):
        counts = Counter(names)
        if max(counts.values()) == 1:
            break
        names = [
            "_".join((*parts[k][-1 - depth : -1], _stem(files[k]))) if counts[name] > 1 else name
            for k, name in enumerate(names)
        ]
    # one folder may hold the same run as .csv and as .mat, which no folder in front tells apart
    counts = Counter(names)
    names = [
        f"{_stem(path)}_{extension(path)[1:].replace('.', '_')}" if counts[name] > 1 else name
        for name, path in zip(names, files, strict=True)
    ]
    return [name if name not in names[:k] else f"{name}_{k + 1}" for k, name in enumerate(names)]

"""Who handed in what: terms, their groups, and the files of each group, ready to travel to whoever examines them."""

from __future__ import annotations

import hashlib
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from baselines.term.unpack import MOST_BYTES, RIG_FILE, Budget, HandInError, is_archive, of_use, unpacked_in_place
from identification.recordings.files import EXTENSIONS, extension

_YEAR = re.compile(r"(?<!\d)(?:19|20)\d\d(?!\d)")
_SEASONS = (("winter",), ("spring",), ("summer",), ("fall", "autumn"))


@dataclass(frozen=True)
class Group:
    """One hand-in.

    Attributes
    ----------
    term
        Which term; empty where there is only one.
    name
        Of the group or rig.
    path
        Folder or archive.
    """

    term: str
    name: str
    path: Path

    @property
    def label(self) -> str:
        """Return term and name in one."""
        return f"{self.term} / {self.name}" if self.term else self.name


@dataclass(frozen=True)
class Parcel:
    """The files of a hand-in. Pickled it holds their bytes, so that whoever examines it needs no file system of ours.

    Attributes
    ----------
    files
        Path from the hand-in down, and where it lies or what it holds.
    """

    files: tuple[tuple[str, Path | bytes], ...]

    def __reduce__(self) -> tuple[Any, ...]:
        return Parcel, (tuple((name, _content(at)) for name, at in self.files),)

    @property
    def size(self) -> int:
        """Bytes of all files."""
        return sum(at.stat().st_size if isinstance(at, Path) else len(at) for _, at in self.files)

    def digest(self) -> str:
        """Return a digest of names and contents: what it takes to know the result."""
        found = hashlib.sha256()
        for name, at in self.files:
            content = _content(at)
            found.update(f"{name}\0{len(content)}\0".encode())
            found.update(content)
        return found.hexdigest()

    def lay_out(self, folder: Path) -> list[tuple[str, str]]:
        """Write the files into a folder, archives unpacked; return archives that were left out, with reasons.

        Raises
        ------
        HandInError
            If there is more than a hand-in may hold.
        """
        budget, refused = Budget(), []
        for name, at in self.files:
            file = folder / name
            file.parent.mkdir(parents=True, exist_ok=True)
            content = _content(at)
            budget.take(len(content))
            file.write_bytes(content)
            if is_archive(file):
                refused += unpacked_in_place(file, name, budget)
        return refused


def _content(at: Path | bytes) -> bytes:
    return at if isinstance(at, bytes) else at.read_bytes()


def parcel(group: Group) -> Parcel:
    """Return a group's files: the archive, or what lies in the folder and may be read; links within it are not followed.

    Raises
    ------
    HandInError
        If there is nothing to read, or more than a hand-in may hold.
    """
    if group.path.is_file():
        return Parcel(((group.path.name, group.path),))
    files = tuple(
        (path.relative_to(group.path).as_posix(), path)
        for path in sorted(group.path.rglob("*"))
        if of_use(PurePosixPath(path.relative_to(group.path).as_posix())) and path.is_file() and not path.is_symlink()
    )
    if not any(PurePosixPath(name).name != RIG_FILE for name, _ in files):
        listed = ", ".join(p.name for p in sorted(group.path.iterdir())[:5]) or "nothing"
        raise HandInError(
            f"folder: must hold recordings or a zip archive of them; got {listed}. Export the logs as .csv or .mat."
        )
    found = Parcel(files)
    if found.size > MOST_BYTES:
        raise HandInError(
            f"folder: must hold at most {MOST_BYTES >> 20} MB of recordings; got {found.size >> 20} MB. Leave out what is not "
            "this rig's."
        )
    return found


def find_groups(folders: Sequence[Path], terms: bool | None = None) -> tuple[tuple[Group, ...], tuple[str, ...]]:
    """Return the groups of all terms, and sentences on what belongs to none.

    Parameters
    ----------
    folders
        One folder of groups, or one folder for each term.
    terms
        Whether the one folder holds terms instead of groups; default: it does where every subfolder's name has a year in it
        and holds no recordings itself.

    Returns
    -------
    groups, notes

    Raises
    ------
    ValueError
        If there is no group.
    """
    notes: list[str] = []
    roots = list(folders)
    several = len(roots) > 1
    if not several and (terms or (terms is None and _look_like_terms(roots[0]))):
        roots, several = sorted((p for p in _members(roots[0]) if p.is_dir()), key=_time), True
    names = [root.resolve().name for root in roots]
    names = [
        name if names.count(name) == 1 else "/".join(root.resolve().parts[-2:])
        for name, root in zip(names, roots, strict=True)
    ]
    groups: list[Group] = []
    for root, name in zip(roots, names, strict=True):
        own, beside = _groups_of(root, name if several else "")
        groups += own
        if beside:
            listed = ", ".join(p.name for p in beside[:3]) + (f" and {len(beside) - 3} more" if len(beside) > 3 else "")
            notes.append(f"{root.name}: {listed} lie beside the groups' folders and belong to no group")
    if not groups:
        raise ValueError(
            f"FOLDER: must hold a subfolder or a zip archive for each group; got {', '.join(map(str, folders))}, which hold "
            "none. Give the folder that the groups' folders lie in."
        )
    return tuple(groups), tuple(notes)


def _groups_of(root: Path, term: str) -> tuple[list[Group], list[Path]]:
    members = _members(root)
    inside = [p for p in members if p.is_dir() or is_archive(p)]
    beside = [p for p in members if p.is_file() and extension(p) in EXTENSIONS]
    if not inside:
        return ([Group(term, root.resolve().name, root)], []) if beside else ([], [])
    stems = Counter(_stem(p) for p in inside)
    return [Group(term, _stem(p) if stems[_stem(p)] == 1 else p.name, p) for p in inside], beside


def _stem(path: Path) -> str:
    return path.name if path.is_dir() else path.stem


def _members(root: Path) -> list[Path]:
    """Return what lies in a folder, hidden things aside, Group 2 before Group 10."""
    visible = [p for p in root.iterdir() if not p.name.startswith(".") and p.name != "__MACOSX"]
    return sorted(visible, key=lambda p: [(part.isdigit(), int(part) if part.isdigit() else 0, part)
                                          for part in re.split(r"(\d+)", p.name.lower()) if part])  # fmt: skip


def _look_like_terms(root: Path) -> bool:
    inside = [p for p in _members(root) if p.is_dir()]
    return bool(inside) and all(
        _YEAR.search(p.name) and not any(q.is_file() and extension(q) in EXTENSIONS for q in p.iterdir())
        for p in inside
    )


def _time(term: Path) -> tuple[int, int]:
    """Return when a term was, by the year and the season in its name."""
    year = _YEAR.search(term.name)
    season = next((k for k, names in enumerate(_SEASONS) if any(n in term.name.lower() for n in names)), len(_SEASONS))
    return (int(year[0]) if year else 0), season


def rig_file(folder: Path) -> Path | None:
    """Return the rig description of a laid out hand-in, the one that lies highest; ``None`` without one."""
    return min(folder.rglob(RIG_FILE), key=lambda p: (len(p.parts), p.as_posix()), default=None)

"""What an export is: a text, and what a reader must know of it."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

_MATLAB_LONGEST = 63


@dataclass(frozen=True)
class Exported:
    """The content of a file for another tool.

    Attributes
    ----------
    text
        Of the file.
    held, left_out
        What of the drive or controller is in it, and what is not, with the reason; a line each.
    notes
        What a user of the file must know.
    header
        Text of the header that belongs to C; empty otherwise.
    """

    text: str
    held: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    header: str = ""


def function_name(path: Path) -> str:
    """Return the name of the function in a file, which MATLAB takes from the file's, and C from an identifier.

    Raises
    ------
    ValueError
        If the file's name is no name of a function.
    """
    name = path.stem
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name) or len(name) > _MATLAB_LONGEST:
        better = re.sub(r"\W+", "_", name).strip("_")[:_MATLAB_LONGEST]
        better = better if better[:1].isalpha() else f"rig_{better}"
        raise ValueError(
            f"output: the file's name becomes that of a function: a letter, then letters, digits and _; got {path.name!r}. Try "
            f"-o {path.with_name(better + path.suffix)}."
        )
    return name


def number(value: float) -> str:
    """Return a number with all its digits, as MATLAB and C read it."""
    if value in (float("inf"), float("-inf")):
        return "Inf" if value > 0.0 else "-Inf"
    return repr(float(value))

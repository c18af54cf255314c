"""What an export is: a text, and what a reader must know of it."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

_MATLAB_LONGEST = 63
# words of C99, MATLAB and Octave
_RESERVED = frozenset((
    "auto", "break", "case", "catch", "char", "classdef", "const", "continue", "default", "do", "double",
    "else", "elseif", "end", "enum", "extern", "float", "for", "function", "global", "goto", "if", "inline",
    "int", "long", "main", "otherwise", "parfor", "persistent", "register", "restrict", "return", "short",
    "signed", "sizeof", "spmd", "static", "struct", "switch", "try", "typedef", "union", "unsigned", "until",
    "unwind_protect", "void", "volatile", "while",
))  # fmt: skip


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


def identifier(text: str) -> str:
    """Return a name of a function made from any text."""
    name = re.sub(r"\W+", "_", text, flags=re.ASCII).strip("_")[:_MATLAB_LONGEST]
    return name if name[:1].isalpha() and name not in _RESERVED else f"rig_{name}"[:_MATLAB_LONGEST]


def function_name(path: Path) -> str:
    """Return the name of the function in a file, which MATLAB takes from the file's, and C from an identifier.

    Raises
    ------
    ValueError
        If the file's name is no name of a function.
    """
    name = path.stem
    if name != identifier(name):
        better = path.with_name(identifier(name) + path.suffix)
        raise ValueError(
            "output: the file's name becomes that of a function: a letter, then letters, digits and _, and no word of the "
            f"language; got {path.name!r}. Try -o {better}."
        )
    return name


def number(value: float) -> str:
    """Return a number with all its digits, as MATLAB and C read it."""
    if value in (float("inf"), float("-inf")):
        return "Inf" if value > 0.0 else "-Inf"
    return repr(float(value))

"""A translated function, and what every function of the step has in common."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

Scope = Mapping[str, Any]

ARRAYS = ("z", "memory")
# parameters of functions that a specialised step does without; ``c`` is another name of ``z`` where there is a workspace
DROPPED = {"table", "c"}
# arguments that decide which variant of a function is called
DECIDING = {"o", "oz", "r", "step"}
ZERO = {"ANCHOR_1", "ANCHOR_2", "PUSH_1", "PUSH_2", "LEVEL_1", "LEVEL_2"}
NOTES = ("BEGIN_1", "BEGIN_2", "BEGIN_T", "RECOIL")
# how strongly a name or a number binds; operators are below
ATOM = 9


class UntranslatableError(ValueError):
    """A construct of the step's source that is not written in MATLAB."""


@dataclass
class Function:
    """One function of the step, for one choice of its deciding arguments."""

    name: str
    mark: str
    given: list[str] = field(default_factory=list)
    parameters: list[str] = field(default_factory=list)
    results: int = 0
    outputs: list[str] = field(default_factory=list)
    writes: list[str] = field(default_factory=list)
    text: str = ""
    inline: tuple[str, int] | None = None


def parameters_of(plain: Callable[..., Any]) -> list[str]:
    """Return the names of a function's parameters."""
    return list(inspect.signature(plain).parameters)


def split(names: str) -> list[str]:
    """Return names from a list with commas."""
    return [name.strip() for name in names.split(",") if name.strip()]

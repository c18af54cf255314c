"""Checks of arguments: what is wrong is named, with the rule, the value and the nearest name."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from typing import Any

import numpy as np


def is_number(value: Any) -> bool:
    """Whether a value is one finite number."""
    return isinstance(value, int | float | np.number) and not isinstance(value, bool) and bool(np.isfinite(value))


def check_positive(name: str, value: Any) -> None:
    """Refuse what is no positive number."""
    if not is_number(value) or not value > 0.0:
        raise ValueError(f"{name}: must be a positive number; got {value!r}.")


def check_member(name: str, value: Any, allowed: Mapping[str, Any]) -> None:
    """Refuse what is not among the names that are allowed."""
    if not isinstance(value, str) or value not in allowed:
        raise ValueError(
            f"{name}: must be among {', '.join(allowed)}; got {value!r}.{did_you_mean(str(value), allowed)}"
        )


def did_you_mean(value: str, allowed: Iterable[str]) -> str:
    """Return a question with the nearest name, empty where none is near."""
    near = get_close_matches(value, list(allowed), n=1)
    return f" Did you mean {near[0]!r}?" if near else ""


def as_mapping(name: str, value: Any, example: str) -> dict[str, Any]:
    """Return a dictionary by names, or say what was given instead."""
    if value is None:
        return {}
    if not isinstance(value, Mapping) or not all(isinstance(key, str) for key in value):
        raise TypeError(f"{name}: must be a mapping from names to values; got {value!r}. Try {name}={example}.")
    return dict(value)

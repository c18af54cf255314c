"""Fill the templates of exports."""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import cache
from math import inf
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from jinja2 import Environment


_WIDTH = 120


@cache
def _environment() -> Environment:
    from jinja2 import Environment, PackageLoader, StrictUndefined  # noqa: PLC0415

    # what is written is source code, not a page: nothing is to be escaped
    environment = Environment(
        loader=PackageLoader("baselines.export", "templates"),
        autoescape=False,  # noqa: S701
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {
        "c": _c,
        "m": _m,
        "c_vector": lambda values: _rows([values], _c, ", ", ",", "{}", outer=False),
        "c_matrix": lambda rows: _rows(rows, _c, ", ", ",", "{}"),
        "m_vector": lambda values: _rows([[v] for v in values], _m, ", ", "; ...", "[]"),
        "m_matrix": lambda rows: _rows(rows, _m, ", ", "; ...", "[]"),
        "c_reading": lambda cart: f"x{cart}",
        "m_reading": lambda cart: f"x{cart}",
    }
    return environment


def _c(value: float) -> str:
    """Return a number with all its digits in C."""
    return repr(float(value)) if abs(value) < inf else ("INFINITY" if value > 0.0 else "-INFINITY")


def _m(value: float) -> str:
    """Return a number with all its digits in MATLAB."""
    return repr(float(value)) if abs(value) < inf else ("Inf" if value > 0.0 else "-Inf")


def _rows(
    rows: Iterable[Iterable[float]], one: Any, between: str, after: str, brackets: str, *, outer: bool = True
) -> str:
    """Return numbers row by row, each on lines of its own that are no longer than an editor likes."""
    lines = []
    for row in rows:
        inside = _wrapped([one(v) for v in row], between, " ..." if brackets == "[]" else "")
        lines.append(inside if brackets == "[]" else f"{brackets[0]}{inside}{brackets[1]}")
    if not outer:
        return lines[0]
    separator = f"{after}\n    "
    return f"{brackets[0]}{separator.join(lines)}{brackets[1]}"


def _wrapped(words: list[str], between: str, at_end: str) -> str:
    lines, line = [], ""
    for i, word in enumerate(words):
        piece = word + (between if i + 1 < len(words) else "")
        if line and len(line) + len(piece) > _WIDTH:
            lines.append(line.rstrip() + at_end)
            line = ""
        line += piece
    return "\n    ".join([*lines, line])


def fill(template: str, *, code: str = "", **content: Any) -> str:
    """Return a template of this package, filled.

    Parameters
    ----------
    template
        Its file.
    code
        Text that goes in as it is.
    **content
        Whatever else it shows. Names and units come from a user's files and stand in comments, so they must not end these.
    """
    dashes = template.endswith(".xml.j2")
    return _environment().get_template(template).render(code=code, **{k: _quiet(v, dashes) for k, v in content.items()})


def _quiet(value: Any, dashes: bool) -> Any:
    """Return texts on one line each, without what would end a comment."""
    if isinstance(value, str):
        text = " ".join(value.split()).replace("*/", "* /").replace("/*", "/ *")
        return re.sub(r"-(?=-)", "- ", text).removesuffix("-") if dashes else text
    if isinstance(value, list | tuple):
        return type(value)(_quiet(v, dashes) for v in value)
    if isinstance(value, dict):
        return {k: _quiet(v, dashes) for k, v in value.items()}
    return value

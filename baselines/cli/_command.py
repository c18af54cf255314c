"""What every command has beyond typer's: finite numbers, and help that keeps its units."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Any

import typer
from typer.core import TyperCommand

# a seed must fit every generator there is: NumPy's global one takes 32 bits
MOST_SEED = 2**32 - 1
MOST_THREADS = 1024


def jobs_given(value: int) -> int:
    """Refuse ``--jobs 0``, which is neither a number of workers nor as many as cores."""
    if value == 0:
        raise typer.BadParameter("0 is neither a number of workers (at least 1) nor -1, as many as cores.")
    return value


def positive(value: Any) -> Any:
    """Refuse a size, or one of several, that is not above 0; how large it may be depends on the rig's units."""
    for number in value if isinstance(value, list | tuple) else [value]:
        if number is not None and not number > 0.0:
            raise typer.BadParameter(f"{number:g} is not above 0.")
    return value


class Command(TyperCommand):
    """A command of ``flexdrive``."""

    def __init__(self, *arguments: Any, **settings: Any) -> None:
        super().__init__(*arguments, **settings)
        # square brackets of units would be read as markup and vanish
        self.help = _escaped(self.help)
        for parameter in self.params:
            if hasattr(parameter, "help"):
                parameter.help = _escaped(parameter.help)

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse; say what was given where it breaks a rule; refuse nan, which lies within any range, inf, and nothing at all."""
        for place, text in enumerate(args, start=1):
            # as a path nothing would be the present folder
            if not text or (text.startswith("--") and text.endswith("=")):
                raise typer.BadParameter(
                    f"argument {place} must not be empty; got {text!r}. Is a variable of the shell unset? "
                    "The present folder is '.'.",
                    ctx=ctx,
                )
        try:
            rest = super().parse_args(ctx, args)
        except typer.BadParameter as error:
            given = _given(error)
            if given and given not in error.message:
                error.message = f"{error.message}; got {given}."
            raise
        for parameter in self.params:
            for value in _numbers(ctx.params.get(parameter.name)):
                if not math.isfinite(value):
                    told: Any = parameter
                    raise typer.BadParameter(f"{value} is not a finite number.", ctx=ctx, param=told)
        return rest


def _given(error: typer.BadParameter) -> str:
    """Return the value that was refused, where the check of its type knows it."""
    told = getattr(error.__cause__, "errors", None)
    return ", ".join(str(e["input"]) for e in told()) if told else ""


def _numbers(value: Any) -> Iterator[float]:
    if isinstance(value, float):
        yield value
    elif isinstance(value, Iterable) and not isinstance(value, str | bytes):
        for item in value:
            yield from _numbers(item)


def _escaped(text: str | None) -> str | None:
    from rich.markup import escape  # noqa: PLC0415  (keeps the start quick)

    return None if text is None else escape(text)

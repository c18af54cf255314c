"""How commands speak: tables on a terminal, one JSON object with ``--json``, errors in a sentence."""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from baselines.cli._tables import PIPED_WIDTH, columns_given, laid_out, wrapped_sentence

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress

    from flexdrive_gym import Fault

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output instead of tables.")]
Recordings = Annotated[
    list[Path],
    typer.Argument(
        exists=True,
        help="Folder (searched recursively) or files: text, .mat, .npz, .h5, .xlsx, .parquet.",
        metavar="RECORDINGS...",
    ),
]
DriveFile = Annotated[Path, typer.Argument(exists=True, dir_okay=False, help="A drive.toml.", metavar="DRIVE")]


def plain(value: Any) -> Any:
    """Return a value as JSON knows it: dataclasses become objects, nan and inf become null."""
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(v) for v in value]
    return value


def print_json(value: Any) -> None:
    """Print one JSON object on standard output."""
    print(json.dumps(plain(value), ensure_ascii=False))


def number(value: float | None, digits: int = 4) -> str:
    """Return a number for a table cell; a dash where there is none."""
    if value is None or not math.isfinite(value):
        return "–"
    return f"{value:.{digits}g}"


def interval(bounds: tuple[float, float] | None) -> str:
    """Return a 95 % interval for a table cell."""
    return "" if bounds is None else f"{bounds[0]:.4g} … {bounds[1]:.4g}"


def table(title: str, columns: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table as wide as the terminal, as ``COLUMNS`` or, piped, as 140 characters; numbers are right-aligned."""
    from rich.text import Text  # noqa: PLC0415  (keeps --help quick)

    console = _console()
    # soft_wrap: the lines are laid out, and square brackets of units are no markup
    console.print(Text(wrapped_sentence(title, console.width), style="bold"), soft_wrap=True)
    for i, sheet in enumerate(laid_out(columns, rows, console.width)):
        if i:
            console.print()
        head = next(n for n, line in enumerate(sheet) if line.startswith("─"))
        console.print(Text("\n".join(sheet[:head]), style="bold"), soft_wrap=True)
        console.print(Text("\n".join(sheet[head:])), soft_wrap=True)


def _console() -> Console:
    from rich.console import Console  # noqa: PLC0415

    width = columns_given() or (None if Console().is_terminal else PIPED_WIDTH)
    return Console(width=width, highlight=False)


def print_faults(title: str, faults: Sequence[Fault]) -> None:
    """Print the faults of recordings but for saturation, which is no fault of a sensor; nothing where there are none."""
    from identification.recordings.faults import gathered  # noqa: PLC0415  (keeps --help quick)

    shown = gathered(faults)
    if shown:
        rows = [[f.recording, f.where, f.id, f"{f.start_s:.3f}", f"{f.end_s:.3f}", f.note] for f in shown]
        table(title, ["recording", "where", "fault", "from [s]", "to [s]", "note"], rows)


def say(text: str) -> None:
    """Print a sentence, wrapped between words."""
    console = _console()
    console.print(wrapped_sentence(text, console.width), markup=False, soft_wrap=True)


@contextmanager
def progress() -> Iterator[Progress]:
    """Show progress on standard error, so that standard output stays clean; nothing where that is no terminal."""
    from rich.console import Console  # noqa: PLC0415
    from rich.progress import (  # noqa: PLC0415
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TaskID,
        TextColumn,
        TimeElapsedColumn,
    )

    class Lines(Progress):
        def update(self, task_id: TaskID, **changes: Any) -> None:
            if changes.get("description") not in {None, self.tasks[task_id].description}:
                print(changes["description"], file=sys.stderr, flush=True)
            super().update(task_id, **changes)

    console = Console(stderr=True)
    kind = Lines if os.environ.get("FLEXDRIVE_PROGRESS") == "lines" else Progress
    with kind(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        console=console,
        disable=not console.is_terminal,
        transient=True,
    ) as bar:
        yield bar

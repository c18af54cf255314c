"""``flexdrive report``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from baselines.commands._output import Json, Recordings, print_json, progress, say
from baselines.commands._results import result_file

if TYPE_CHECKING:
    from identification import Diagnosis


def report(
    recordings: Recordings,
    output: Annotated[Path, typer.Option("--output", "-o", help="Where to write the page.")] = Path("report.html"),
    title: Annotated[str, typer.Option(help="Heading of the page.")] = "Flexible drive: Lab 3 report",
    json: Json = False,
) -> None:
    """Write the handout's whole report (3.5) as one HTML page."""
    result_file(output)
    written = write_report(recordings, output, title)
    if json:
        print_json({"report": written})
    else:
        say(f"wrote {written}")


def write_report(recordings: list[Path], output: Path, title: str, diagnosis: Diagnosis | None = None) -> Path:
    """Read, compute, render and write; show progress."""
    from baselines.report import STEPS, build_report  # noqa: PLC0415
    from flexdrive_gym.files import write_atomically  # noqa: PLC0415
    from identification import read_recordings  # noqa: PLC0415

    with progress() as bar:
        task = bar.add_task("reading recordings", total=STEPS + 1)
        runs = read_recordings(recordings)

        def tell(step: str) -> None:
            bar.update(task, advance=1, description=step)

        return write_atomically(output, build_report(runs, title=title, diagnosis=diagnosis, progress=tell))

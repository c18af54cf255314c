"""``flexdrive report``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from baselines.cli._output import Json, Recordings, print_json, progress, say
from baselines.cli._reading import Only, RigFile, Skip, Strict, read, skipped_json, skipped_lines
from baselines.cli._results import result_file

if TYPE_CHECKING:
    from flexdrive_gym import Recording
    from identification import Diagnosis


def report(
    recordings: Recordings,
    output: Annotated[Path, typer.Option("--output", "-o", help="Where to write the page.")] = Path("report.html"),
    title: Annotated[str, typer.Option(help="Heading of the page.")] = "Flexible drive: Lab 3 report",
    rig: RigFile = None,
    strict: Strict = False,
    only: Only = None,
    skip: Skip = None,
    json: Json = False,
) -> None:
    """Write the handout's whole report (3.5) as one HTML page."""
    result_file(output)
    runs = read(recordings, rig, strict, only, skip)
    written = write_report(runs, output, title)
    if json:
        print_json({"report": written, "skipped": skipped_json(runs)})
    else:
        for line in skipped_lines(runs):
            say(line)
        say(f"wrote {written}")


def write_report(runs: Sequence[Recording], output: Path, title: str, diagnosis: Diagnosis | None = None) -> Path:
    """Compute, render and write; show progress."""
    from baselines.report import STEPS, build_report  # noqa: PLC0415
    from flexdrive_gym.files import write_atomically  # noqa: PLC0415

    with progress() as bar:
        task = bar.add_task("identifying", total=STEPS + 1)

        def tell(step: str) -> None:
            bar.update(task, advance=1, description=step)

        return write_atomically(output, build_report(runs, title=title, diagnosis=diagnosis, progress=tell))

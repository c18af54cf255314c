"""``flexdrive check``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from baselines.cli._command import MOST_THREADS
from baselines.cli._output import Json, Recordings, print_json, progress, say, table
from baselines.cli._reading import Only, RigFile, Skip, Strict, read


def check(
    recordings: Recordings,
    rig: RigFile = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", dir_okay=False, help="Write a rig.toml of what was understood, to edit."),
    ] = None,
    strict: Strict = False,
    only: Only = None,
    skip: Skip = None,
    threads: Annotated[
        int | None, typer.Option(min=1, max=MOST_THREADS, help="Threads; the answer does not change.")
    ] = None,
    json: Json = False,
) -> None:
    """Say what recordings are and what they can identify, before anything is fitted."""
    from identification import check as run  # noqa: PLC0415
    from identification.readiness.describe import write_description  # noqa: PLC0415
    from identification.recordings.recording_set import reasons  # noqa: PLC0415

    with progress() as bar:
        task = bar.add_task("reading recordings", total=2)
        runs = read(recordings, rig, strict, only, skip)
        bar.update(task, advance=1, description="checking")
        found = run(runs, folders=recordings, threads=threads)
        bar.advance(task)
    if output is not None:
        folder = recordings[0] if recordings[0].is_dir() else recordings[0].parent
        write_description(found, output, folder.resolve().name)
    if json:
        print_json(found.as_json() | ({} if output is None else {"rig": output}))
        return
    say(runs.summary())
    for line in reasons(runs.skipped):
        say(f"  {line}")
    for title, columns, rows in found.tables():
        table(title, columns, rows)
    for line in found.sentences():
        say(line)
    if output is not None:
        say(f"wrote {output}")

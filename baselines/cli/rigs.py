"""``flexdrive rigs``."""

from __future__ import annotations

import json as encoder
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from baselines.cli._command import MOST_SEED, MOST_THREADS
from baselines.cli._output import Json, print_json, progress, say, table
from baselines.cli._results import interrupted_says

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from baselines.real_rigs import RealRig


def rigs(
    data: Annotated[
        Path, typer.Option("--data", "-d", exists=True, file_okay=False, help="Folder that holds the rigs' folders.")
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", file_okay=False, help="Folder for rigs.html, rigs.json and NAME.json.")
    ],
    only: Annotated[
        list[str] | None, typer.Option("--only", metavar="NAME", help="Examine only this rig; repeatable.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, max=MOST_SEED, help="Of null draws; the same seed, the same answer.")] = 0,
    jobs: Annotated[
        int | None, typer.Option(min=1, max=MOST_THREADS, help="Threads; the answer does not change.")
    ] = None,
    again: Annotated[bool, typer.Option("--again", help="Examine rigs whose result is kept, too.")] = False,
    json: Json = False,
) -> None:
    """Diagnose real rigs without what their documentation says is there, and tell what was found of it."""
    from baselines.real_rigs.entries import RIGS  # noqa: PLC0415
    from baselines.real_rigs.study import kept_rows, study, summary  # noqa: PLC0415
    from baselines.report.rigs_page import OVERVIEW, build_rigs_page, overview, sentences  # noqa: PLC0415
    from flexdrive_gym.files import only_writer, write_together  # noqa: PLC0415

    chosen = {name: RIGS[name] for name in _names(only, RIGS)}
    kept = f"finished rigs are kept in {output}. The same command goes on."
    with interrupted_says(lambda: kept), only_writer(output), progress() as bar:
        task = bar.add_task("reading", total=None)
        done = study(
            chosen,
            data,
            output,
            again=again,
            seed=seed,
            jobs=jobs,
            say=lambda step: bar.update(task, advance=1, description=step),
        )
        rows = {**(kept_rows(RIGS, output) if only else {}), **{row["rig"]: row for row in done}}
        found = summary([rows[name] for name in RIGS if name in rows])
        page = build_rigs_page(found, command=f"flexdrive rigs --data {data.name} --seed {seed}")
        text = encoder.dumps(found, ensure_ascii=False, indent=1, allow_nan=False) + "\n"

        def write(folder: Path) -> None:
            (folder / "rigs.html").write_text(page, encoding="utf-8")
            (folder / "rigs.json").write_text(text, encoding="utf-8")

        write_together(output, write)
    if json:
        print_json(found)
        return
    for line in sentences(found):
        say(line)
    say("")
    table("rigs", list(OVERVIEW), [list(overview(r)) for r in found["rigs"]])
    say(f"wrote {output / 'rigs.html'} and {output / 'rigs.json'}")


def _names(only: Sequence[str] | None, rigs: Mapping[str, RealRig]) -> list[str]:
    from difflib import get_close_matches  # noqa: PLC0415

    for name in only or ():
        if name not in rigs:
            near = get_close_matches(name, rigs, n=1, cutoff=0.4)
            hint = f" Did you mean {near[0]}?" if near else ""
            raise typer.BadParameter(f"must be one of {', '.join(rigs)}; got {name!r}.{hint}", param_hint="--only")
    return [name for name in rigs if not only or name in only]

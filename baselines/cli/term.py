"""``flexdrive term``."""

from __future__ import annotations

import json as encoder
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from baselines.cli._command import MOST_SEED, MOST_THREADS, jobs_given
from baselines.cli._output import Json, number, print_json, progress, say, table
from baselines.cli._reading import Only, RigFile, Skip, Strict
from baselines.cli._results import interrupted_says

if TYPE_CHECKING:
    from baselines.term.summary import Term


class Backend(StrEnum):
    """Where groups are examined."""

    loky = "loky"
    sequential = "sequential"
    dask = "dask"


def term(
    folders: Annotated[
        list[Path],
        typer.Argument(
            exists=True,
            file_okay=False,
            metavar="FOLDER...",
            help="A subfolder or zip archive for each group or rig. Several folders, or one that holds them, are terms.",
        ),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", file_okay=False, help="Folder for the page; an interrupted run goes on.")
    ] = Path("term"),
    terms: Annotated[
        bool | None,
        typer.Option(
            "--terms/--groups",
            help="The one folder holds terms, or groups; default: terms if all are named with a year.",
        ),
    ] = None,
    diagnose: Annotated[
        bool, typer.Option("--diagnose/--no-diagnose", help="Also name the physics that each rig's model lacks.")
    ] = True,
    draws: Annotated[
        int, typer.Option(min=0, max=100_000, help="Drives drawn for the intervals of critical gains; 0 for none.")
    ] = 100,
    seed: Annotated[int, typer.Option(min=0, max=MOST_SEED, help="Of the draws and the diagnosis.")] = 0,
    backend: Annotated[
        Backend, typer.Option(help="Where groups are examined; the answers do not change.")
    ] = Backend.loky,
    jobs: Annotated[
        int,
        typer.Option(
            min=-1,
            max=MOST_THREADS,
            callback=jobs_given,
            help="Groups at a time on this machine; -1: as many as cores.",
        ),
    ] = -1,
    scheduler: Annotated[str | None, typer.Option(help="Address of a Dask scheduler, tcp://HOST:PORT.")] = None,
    plan: Annotated[
        int | None,
        typer.Option(
            min=1, max=100_000, metavar="GROUPS", help="Also print what so many groups would cost, from what these did."
        ),
    ] = None,
    recordings: Annotated[int, typer.Option(min=1, max=10_000, help="Recordings of a group, for the plan.")] = 20,
    rig: RigFile = None,
    strict: Strict = False,
    only: Only = None,
    skip: Skip = None,
    json: Json = False,
) -> None:
    """Put a term on one page: every group checked, identified and diagnosed, who stands out, what changed since the last term.

    A broken hand-in is a row with its reason. What is done is kept in the folder; the same command goes on where it was
    interrupted, and examines only what is new.
    """
    from baselines.term.examine import Settings  # noqa: PLC0415
    from baselines.term.groups import find_groups  # noqa: PLC0415
    from baselines.term.study import examine_all, kept_in  # noqa: PLC0415
    from baselines.term.summary import summarise  # noqa: PLC0415
    from flexdrive_gym.files import only_writer  # noqa: PLC0415

    groups, notes = find_groups(folders, terms)
    described = "" if rig is None else rig.read_text(encoding="utf-8")
    settings = Settings(diagnose, draws, seed, described, strict=strict, only=tuple(only or ()), skip=tuple(skip or ()))

    def kept() -> str:
        done = len(list(kept_in(output).glob("*.json")))
        return f"{done} groups are done and kept in {output}. The same command goes on from there."

    with interrupted_says(kept), only_writer(output), progress() as bar:
        task = bar.add_task("examining groups", total=len(groups))

        def told(done: int, of: int, name: str) -> None:
            bar.update(task, completed=done, total=of, description=name or "examining groups")

        rows = examine_all(groups, output, settings, backend=backend.value, jobs=jobs, scheduler=scheduler, told=told)
        bar.update(task, description="comparing")
        found = summarise(groups, rows, notes)
        page = _write(found, folders[0].resolve().name, output)
    planned = _plan(found, plan, recordings) if plan is not None else None
    if json:
        print_json({**found.as_json(), **({} if planned is None else {"plan": planned}), "page": page})
        return
    print_term(found)
    if planned is not None:
        print_plan(planned)
    say(f"wrote {page}, {output / 'term.json'} and {len(found.usable)} drives in {output / 'drives'}")


def _write(found: Term, folder: str, output: Path) -> Path:
    """Write page, figures, and every group's drive and diagnosis; return the page's path.

    The page is named after the terms, or after the ``folder`` of the groups where they have no names.
    """
    from baselines.report.term_page import build_term_page  # noqa: PLC0415
    from flexdrive_gym.files import write_atomically  # noqa: PLC0415

    title = (" and ".join(t for t in found.terms if t) or folder).replace("_", " ")
    page = write_atomically(output / "term.html", build_term_page(found, title=f"{title}: a term at a glance"))
    content = encoder.dumps(found.as_json(), ensure_ascii=False, indent=1)
    write_atomically(output / "term.json", content + "\n")
    _write_drives(found, output)
    return page


def _write_drives(found: Term, output: Path) -> None:
    """Write every group's drive, the diagnosed one where there is one, for the other commands, and its diagnosis."""
    from flexdrive_gym.files import write_atomically  # noqa: PLC0415

    for group, row in found.usable:
        name = "_".join(part.replace("/", "_") for part in (group.term, group.name) if part)
        write_atomically(output / "drives" / f"{name}.toml", row.get("diagnosed", row["drive"]))
        if "diagnosis" in row:
            told = encoder.dumps({**row["diagnosis"], "drive": f"../drives/{name}.toml"}, ensure_ascii=False, indent=1)
            write_atomically(output / "diagnoses" / f"{name}.json", told + "\n")


def _plan(found: Term, groups: int, recordings: int) -> dict[str, object]:
    from baselines.term.plan import as_json, measured  # noqa: PLC0415
    from baselines.term.plan import plan as make  # noqa: PLC0415

    costs = measured(found.rows)
    return as_json(costs, make(costs, groups, recordings), groups, recordings)


def print_term(found: Term) -> None:
    """Print the rows of a term and who stands out."""
    names = list(dict.fromkeys(n for _, r in found.usable for n in r["parameters"]))
    table(
        f"{len(found.usable)} of {len(found.groups)} groups identified",
        ["group", "recordings", "left out of the model", *names],
        [
            [
                g.label,
                str(r["recordings"]),
                ", ".join(f["id"] for f in r.get("findings", ())) or r.get("verdict", "–").replace("_", " "),
                *(number(r["parameters"].get(n, {}).get("value"), 3) for n in names),
            ]
            for g, r in found.usable
        ],
    )
    for g, r in zip(found.groups, found.rows, strict=True):
        if r["status"] != "ok":
            say(f"{g.label} was not examined: {r['reason']}")
    for o in found.outliers:
        say(f"stands out: {o.group}: {o.sentence}")
    for c in found.changes:
        if c.significant:
            say(c.sentence())
    for note in found.notes:
        say(f"note: {note}")


def print_plan(planned: dict[str, object]) -> None:
    """Print what a term would cost."""
    cost: dict[str, float] = planned["measured"]  # type: ignore[assignment]
    say(
        f"measured on {cost['groups']:g} groups of {cost['recordings']:g} recordings in all: {cost['seconds']:.3g} s of one "
        f"core a recording (at most {cost['most_seconds']:.3g}), {cost['peak_mb']:.0f} MB a worker, "
        f"{1e3 * cost['mb_in']:.3g} kB there and {1e3 * cost['mb_out']:.3g} kB back"
    )
    rows: list[dict[str, float]] = planned["workers"]  # type: ignore[assignment]
    table(
        f"{planned['groups']} groups of {planned['recordings']} recordings",
        ["cores", "time [h]", "at most [h]", "memory [GB]", "transfer [GB]", "at 50 MB/s [min]"],
        [
            [f"{r['workers']:g}", number(r["hours"], 3), number(r["most_hours"], 3), number(r["memory_gb"], 3),
             number(r["transfer_gb"], 3), number(r["transfer_minutes"], 2)]
            for r in rows
        ],
    )  # fmt: skip

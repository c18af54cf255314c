"""``flexdrive benchmark``."""

from __future__ import annotations

import json as encoder
from contextlib import nullcontext
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from baselines.cli._command import MOST_SEED, MOST_THREADS
from baselines.cli._output import Json, number, plain, print_faults, print_json, progress, say, table
from baselines.cli._results import Force, interrupted_says, result_folder

if TYPE_CHECKING:
    from baselines.public_data import Result


class Name(StrEnum):
    """Names of the benchmarks."""

    emps = "emps"
    coupled_drives = "coupled_drives"
    silverbox = "silverbox"


def benchmark(
    name: Annotated[Name, typer.Argument(help="Which benchmark.", metavar="NAME")],
    data: Annotated[
        Path, typer.Option("--data", "-d", exists=True, file_okay=False, help="Folder with its train* and test* files.")
    ],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", file_okay=False, help="Folder for ladder.png, benchmark.json and drive.toml."),
    ] = None,
    seed: Annotated[
        int, typer.Option(min=0, max=MOST_SEED, help="Of null draws and resampling; the same seed, the same answer.")
    ] = 0,
    jobs: Annotated[
        int | None, typer.Option(min=1, max=MOST_THREADS, help="Threads; the answer does not change.")
    ] = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Diagnose a public data set (emps, coupled_drives, silverbox) and score it by its rule beside published methods."""
    from baselines.public_data import BENCHMARKS, run_benchmark  # noqa: PLC0415

    kept = "nothing of this benchmark is kept. The same command begins again."
    held = nullcontext() if output is None else result_folder(output, "benchmark.json", force=force)
    with interrupted_says(lambda: kept), held, progress() as bar:
        task = bar.add_task("reading", total=None)
        result = run_benchmark(
            BENCHMARKS[name.value],
            data,
            seed=seed,
            jobs=jobs,
            say=lambda step: bar.update(task, advance=1, description=step),
        )
        if output is not None:
            _write(result, output)
    if json:
        print_json(result.as_json())
        return
    _print(result)
    if output is not None:
        say(f"wrote {output / 'ladder.png'}, {output / 'benchmark.json'} and {output / 'drive.toml'}")


def _write(result: Result, output: Path) -> None:
    from baselines.public_data.plot import draw_ladder  # noqa: PLC0415
    from flexdrive_gym import save_drive  # noqa: PLC0415
    from flexdrive_gym.files import write_together  # noqa: PLC0415

    text = encoder.dumps(plain(result.as_json()), ensure_ascii=False, indent=1)
    picture = draw_ladder(result)

    def write(folder: Path) -> None:
        (folder / "benchmark.json").write_text(text + "\n", encoding="utf-8")
        picture.savefig(folder / "ladder.png")
        save_drive(result.ladder[-1].drive, folder / "drive.toml")

    write_together(output, write)


def _print(result: Result) -> None:
    b = result.benchmark
    print_faults("faults of the files: not fitted, but scored", result.faults)
    for note in result.notes:
        say(f"note: {note}")
    validated = [c for c in b.columns if any(s.part == "validation" and s.column == c for s in result.scores)]
    rule = f"rms of the free simulation [{b.rule.unit}] after {b.rule.window} samples of initialisation"
    table(
        f"{b.title}: {rule}",
        ["fitted to the training recordings", "there", *(f"blocks left out, {c}" for c in validated)],
        [
            [
                _name(rung.name),
                number(result.rms(rung.name, "fitted"), 3),
                *(number(result.rms(rung.name, "validation", c), 3) for c in validated),
            ]
            for rung in result.ladder
        ],
    )
    rows = [
        [_name(rung.name), *(number(result.rms(rung.name, "test", c), 3) for c in b.columns)]
        for rung in (result.ladder if result.tested else ())
    ]
    rows += [[f"published: {p.method}", *(number(f, 3) for f in p.figures)] for p in b.published]
    say("")
    table(
        "test recordings" if result.tested else "no test* files in the folder; published:",
        ["", *b.columns],
        rows,
    )
    say("")
    for name, (low, middle, high) in result.friction.items():
        say(
            f"friction as it differs between blocks of training makes {low:.3g} to {high:.3g} {b.rule.unit} by itself "
            f"(median {middle:.3g}) in {name}"
        )
    for weight, drive in result.ladder[-1].members:
        say(f"- {weight:.0%} of the average: {drive.name}")
    for f in result.found.findings:
        say(f"- {f.statement}")
    if result.found.unnamed is not None:
        u = result.found.unnamed
        say(f"unnamed: {u.share_of_error:.0%} of the remaining error, {u.acts_on}")
    say(f"cite: {b.citation}")


def _name(rung: str) -> str:
    return f"+ {rung.replace('_', ' ').replace('@', ' at ')}" if "@" in rung else rung

"""``flexdrive diagnose``."""

from __future__ import annotations

import json as encoder
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from baselines.cli._command import MOST_SEED, MOST_THREADS
from baselines.cli._output import Json, Recordings, number, plain, print_faults, print_json, progress, say, table
from baselines.cli._reading import Only, RigFile, Skip, Strict, read, skipped_json, skipped_lines
from baselines.cli._results import Force, interrupted_says, result_folder

if TYPE_CHECKING:
    from flexdrive_gym import Recording
    from identification.mismatch.answer.suggest import Suggestion
    from identification.mismatch.answer.verdict import Diagnosis


# nothing of a search is worth keeping before its validation
_KEPT = "nothing of this diagnosis is kept, and {} is as it was. The same command begins again."
_FEWEST_S, _ONE_IS_ENOUGH_S = 5.0, 10.0


def diagnose(
    recordings: Recordings,
    output: Annotated[Path, typer.Option("--output", "-o", file_okay=False, help="Folder for the results.")] = Path(
        "diagnosis"
    ),
    seed: Annotated[
        int,
        typer.Option(
            min=0, max=MOST_SEED, help="Of the null draws and of the drawn drives; the same seed, the same answer."
        ),
    ] = 0,
    alpha: Annotated[
        float,
        typer.Option(
            min=1e-3,
            max=0.5,
            help="Level of the test: in so many data sets in which nothing is left out something is named.",
        ),
    ] = 0.02,
    jobs: Annotated[
        int | None, typer.Option(min=1, max=MOST_THREADS, help="Threads; the answer does not change.")
    ] = None,
    rounds: Annotated[
        int | None,
        typer.Option(min=1, max=20, help="Most rounds of the search, each for one effect; fewer take less time."),
    ] = None,
    suggest: Annotated[
        bool,
        typer.Option("--suggest", help="Also write the experiments that would separate what cannot be told apart."),
    ] = False,
    rig: RigFile = None,
    strict: Strict = False,
    only: Only = None,
    skip: Skip = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Locate, name, model and prove the physics that simulation and recordings disagree about."""
    from identification import check  # noqa: PLC0415

    with (
        interrupted_says(lambda: _KEPT.format(output)),
        result_folder(output, "diagnosis.json", force=force),
        progress() as bar,
    ):
        task = bar.add_task("reading recordings", total=None)

        def tell(step: str) -> None:
            bar.update(task, advance=1, description=step)

        runs = read(recordings, rig, strict, only, skip)
        require_enough(runs)
        tell("checking")
        checked = check(runs, folders=recordings, threads=jobs)
        found, suggestions = write_diagnosis(
            runs,
            output,
            remarks=checked.remarks(),
            seed=seed,
            jobs=jobs,
            alpha=alpha,
            rounds=rounds,
            suggest=suggest,
            tell=tell,
        )
    if json:
        print_json(_content(found, suggestions if suggest else None, runs))
        return
    for line in skipped_lines(runs):
        say(line)
    print_diagnosis(found)
    if suggest:
        print_suggestions(suggestions, output)
    say(f"wrote {output / 'diagnosis.json'}, {output / 'drive.toml'} and {output / 'report.html'}")


def write_diagnosis(
    runs: Sequence[Recording],
    output: Path,
    *,
    seed: int = 0,
    jobs: int | None = None,
    alpha: float = 0.02,
    rounds: int | None = None,
    suggest: bool = False,
    remarks: Sequence[str] = (),
    tell: Callable[[str], None] = lambda _: None,
) -> tuple[Diagnosis, tuple[Suggestion, ...]]:
    """Diagnose, and write diagnosis.json, drive.toml and report.html, all or none; return what was found.

    ``remarks`` on the recordings come before the notes of the diagnosis.
    """
    from baselines.lab.predictions import predictions  # noqa: PLC0415
    from baselines.report.diagnosis import build_diagnosis  # noqa: PLC0415
    from flexdrive_gym import save_drive  # noqa: PLC0415
    from flexdrive_gym.files import write_together  # noqa: PLC0415
    from identification import diagnose as run  # noqa: PLC0415
    from identification.mismatch.answer.suggest import suggest_experiments, write_suggestions  # noqa: PLC0415
    from identification.mismatch.settings import Settings  # noqa: PLC0415

    require_enough(runs)
    settings = None if rounds is None else Settings(rounds=rounds)
    found = run(runs, seed=seed, jobs=jobs, alpha=alpha, settings=settings, say=tell)
    tell("predicting")
    found = replace(found, predictions=predictions(found, seed=seed, threads=jobs), notes=(*remarks, *found.notes))
    suggestions: tuple[Suggestion, ...] = ()
    if suggest:
        tell("looking for experiments")
        suggestions = suggest_experiments(found)
    tell("drawing the page")
    page = build_diagnosis(found, suggestions=suggestions, jobs=jobs)

    def write(folder: Path) -> None:
        text = encoder.dumps(
            plain(_content(found, suggestions if suggest else None, runs)), ensure_ascii=False, indent=1
        )
        (folder / "diagnosis.json").write_text(text + "\n", encoding="utf-8")
        (folder / "report.html").write_text(page, encoding="utf-8")
        save_drive(found.drive, folder / "drive.toml")
        write_suggestions(suggestions, folder)

    write_together(output, write, stale="suggest_*.csv")
    return found, suggestions


def require_enough(runs: Sequence[Recording]) -> None:
    """Refuse what no diagnosis can be made from, and name the experiment to do next.

    Raises
    ------
    ValueError
        With less than five seconds in all, or a single recording shorter than ten.
    """
    from identification.recordings.recording_set import notes_of  # noqa: PLC0415

    seconds = sum(r.n * r.sample_time for r in runs)
    rule = "a diagnosis tells physics from what merely differs between runs, and needs at least two recordings"
    if len(runs) > 1 and seconds < _FEWEST_S:
        rule = f"a diagnosis needs at least {_FEWEST_S:g} s of recordings"
    elif len(runs) > 1 or seconds >= _ONE_IS_ENOUGH_S:
        return
    kinds = "; ".join(sorted({r.excitation.text(r.units) for r in runs}))
    # a column that was ignored may be what is missing
    noted = "; ".join(text for said in notes_of(runs) for text in said)
    raise ValueError(
        f"recordings: {rule}; got {len(runs)} of {seconds:.1f} s in all ({kinds}). Record squares of ±1.5 V and ±2 V at 0.5 Hz "
        "and sines of ±2.5 V from 0.5 to 5 Hz next (handout 2.5, 2.6), or, where the loop cannot be opened, one run of at least "
        f"{_ONE_IS_ENOUGH_S:g} s whose reference moves both ways at several speeds."
        + (f" Noted while reading: {noted}." if noted else "")
    )


def _content(
    found: Diagnosis, suggestions: tuple[Suggestion, ...] | None, runs: Sequence[Recording]
) -> Mapping[str, object]:
    content = found.as_json() | {"skipped": skipped_json(runs)}
    if suggestions is not None:
        content["suggestions"] = [s.as_json() for s in suggestions]
    return content


def print_diagnosis(found: Diagnosis) -> None:
    """Print what was found on a terminal."""
    from baselines.lab.prediction_names import prediction_name  # noqa: PLC0415
    from baselines.report import words  # noqa: PLC0415

    say(f"verdict: {found.verdict.replace('_', ' ')}")
    for line in words.verdict_sentences(found):
        say(line)
    for f in found.findings:
        say(f"- {f.statement}")
        for line in words.tie_sentences(f):
            say(f"  {line}")
    if found.unnamed is not None:
        nearest = ", ".join(f"{words.at(n.id, n.where)} ({s:.0%} alike)" for n, s in found.unnamed.nearest)
        if nearest:
            say(f"nearest to what has no name: {nearest}")
    print_faults("sensor faults, left out", found.faults)
    for line in words.ratio_sentences(found):
        say(line)
    for note in found.notes:
        say(f"note: {note}")
    if found.predictions:
        table(
            "predictions",
            ["", "before [95 %]", "after [95 %]", "unit", "on the rig"],
            [
                [
                    prediction_name(p.name, found.drive.units),
                    words.interval(p.before),
                    words.interval(p.after),
                    p.unit,
                    p.measured or "–",
                ]
                for p in found.predictions
            ],
        )
        for line in words.extrapolation_sentences(found):
            say(f"note: {line}")


def print_suggestions(suggestions: tuple[Suggestion, ...], output: Path) -> None:
    """Print the experiments that would tell most."""
    if not suggestions:
        say("no experiment to suggest: there are no explanations to tell apart")
        return
    table(
        "experiments that would tell most: expected difference of the velocities, in multiples of the floor",
        ["file", *dict.fromkeys(name for s in suggestions for name in s.separation)],
        [[str(output / s.file), *(number(v, 3) for v in s.separation.values())] for s in suggestions],
    )

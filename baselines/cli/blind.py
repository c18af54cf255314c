"""``flexdrive blind``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from baselines.cli._command import MOST_SEED, MOST_THREADS, jobs_given
from baselines.cli._output import Json, number, print_json, progress, say, table
from baselines.cli._results import interrupted_says
from baselines.cli.compare import Backend

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from baselines.blind_study.judge import Judged
    from baselines.blind_study.summary import Summary


def blind(
    output: Annotated[
        Path, typer.Option("--output", "-o", file_okay=False, help="Folder of the study; an interrupted one goes on.")
    ] = Path("blind"),
    trials: Annotated[
        int, typer.Option("--trials", "-n", min=1, max=100_000, help="Concealed data sets; 200 tell the rates.")
    ] = 20,
    seed: Annotated[int, typer.Option(min=0, max=MOST_SEED, help="Everything follows from it.")] = 0,
    backend: Annotated[
        Backend, typer.Option(help="Where trials are computed; the answers do not change.")
    ] = Backend.threading,
    jobs: Annotated[
        int,
        typer.Option(
            min=-1,
            max=MOST_THREADS,
            callback=jobs_given,
            help="Trials at a time on this machine; -1: as many as cores.",
        ),
    ] = -1,
    scheduler: Annotated[str | None, typer.Option(help="Address of a Dask scheduler, tcp://HOST:PORT.")] = None,
    report: Annotated[
        bool, typer.Option("--report", help="Run nothing: figures and page of what the folder holds so far.")
    ] = False,
    json: Json = False,
) -> None:
    """Put the diagnosis to a concealed trial: rigs of an independent program, whose truth is sealed before the diagnosis.

    A trial takes about a minute of one core. What is done is kept in the folder; the same command goes on where it
    was interrupted.
    """
    from baselines.blind_study.judge import judge  # noqa: PLC0415
    from baselines.blind_study.payoff import Payoff  # noqa: PLC0415
    from baselines.blind_study.payoff_summary import summary as payoff_rows  # noqa: PLC0415
    from baselines.blind_study.payoff_summary import tables  # noqa: PLC0415
    from baselines.blind_study.study import settings  # noqa: PLC0415
    from baselines.blind_study.summary import summarise  # noqa: PLC0415
    from baselines.report.trial_page import build_trial_page  # noqa: PLC0415
    from flexdrive_gym.files import write_atomically  # noqa: PLC0415

    if report:
        trials, seed, found = _finished(output)
    else:
        found = _conducted(output, trials, seed, backend=backend.value, jobs=jobs, scheduler=scheduler)
    judged = [judge(outcome) for outcome in found]
    summary = summarise(judged)
    paid = payoff_rows([Payoff.from_json(outcome["payoff"]) for outcome in found if outcome["payoff"]])
    page = write_atomically(
        output / "trial.html",
        build_trial_page(
            summary,
            judged,
            paid,
            command=f"flexdrive blind --trials {trials} --seed {seed}",
            engine=settings(output)["engine"],
        ),
    )
    if json:
        print_json({"summary": summary, "payoff": paid, "trials": judged, "page": page})
        return
    print_summary(summary, judged)
    for title, (columns, rows) in zip(("tracking on the concealed rigs", "margins on them"), tables(paid), strict=True):
        if rows:
            table(title, columns, rows)
    say(f"wrote {page}")


def _finished(output: Path) -> tuple[int, int, list[Mapping[str, Any]]]:
    """Return number of trials, seed and outcomes of the study in a folder as far as it is.

    Raises
    ------
    ValueError
        If it has no outcome yet.
    """
    from baselines.blind_study.plan import plan  # noqa: PLC0415
    from baselines.blind_study.study import outcomes, settings  # noqa: PLC0415

    asked = settings(output)
    found = outcomes(output, plan(asked["trials"], asked["seed"]))
    if not found:
        raise ValueError(f"output: the study in {output} has no outcome yet. Go on with it without --report.")
    return asked["trials"], asked["seed"], found


def _conducted(output: Path, trials: int, seed: int, **where: Any) -> list[Mapping[str, Any]]:
    """Conduct a study, or what is left of it, with a progress bar; ``where`` says where trials are computed."""
    from baselines.blind_study.one import opened  # noqa: PLC0415
    from baselines.blind_study.plan import plan  # noqa: PLC0415
    from baselines.blind_study.study import conduct_study, pack  # noqa: PLC0415
    from flexdrive_gym.files import only_writer  # noqa: PLC0415

    def kept() -> str:
        done = sum(opened(output, trial.number).exists() for trial in plan(trials, seed))
        return (
            f"{done} of {trials} trials are done and kept in {output}. The same command goes on from there; with --report it "
            "shows what there is."
        )

    with interrupted_says(kept), only_writer(output), progress() as bar:
        task = bar.add_task("trials", total=trials)
        found = conduct_study(
            output,
            trials,
            seed=seed,
            progress=lambda done, total: bar.update(task, completed=done, total=total),
            **where,
        )
        pack(output, found)
    return found


def print_summary(summary: Summary, trials: Sequence[Judged]) -> None:
    """Print the figures of a study."""
    from baselines.blind_study.summary import headline, missed_or_false  # noqa: PLC0415

    table(
        f"{summary.trials} concealed trials" + (f", {summary.failed} failed" if summary.failed else ""),
        ["", "value (95 % interval)", "aim"],
        headline(summary),
    )
    if found := missed_or_false(trials):
        table("missed or false", ["trial", "concealed", "found", "wrong"], found)
    sizes = sorted({s for d in summary.detection for s in d.by_size})
    table(
        "named exactly or in a tie, by size; size named in 50 % and 90 % of trials",
        ["effect", *(f"× {s:g}" for s in sizes), "50 %", "90 %"],
        [
            [d.name, *("/".join(map(str, d.by_size[s])) if s in d.by_size else "" for s in sizes), number(d.half, 2),
             number(d.nine_tenths, 2)]
            for d in summary.detection
        ],
    )  # fmt: skip
    table(
        "parameters that mean the same to both programs",
        ["parameter", "median error", "truth inside the 95 % interval"],
        [[a.name, f"{a.median_error:.1%}", str(a.inside)] for a in (*summary.base, *summary.effects)],
    )

"""``flexdrive compare``."""

from __future__ import annotations

from contextlib import ExitStack
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from baselines.commands._command import MOST_SEED, MOST_THREADS, jobs_given
from baselines.commands._output import DriveFile, Json, number, print_json, progress, say, table
from baselines.commands._results import Force, interrupted_says, result_folder

if TYPE_CHECKING:
    from collections.abc import Sequence

    from baselines.compare import Comparison, Improvement, Summary


_KEPT = (
    "nothing of this comparison is kept. The same command begins again; fewer --draws, fewer --controllers and --no-effects take "
    "less time."
)


# a command that is held for longer than a second controls nothing on this drive
_LONGEST_MS = 1000


class Backend(StrEnum):
    """Where runs are computed."""

    threading = "threading"
    loky = "loky"
    dask = "dask"
    sequential = "sequential"


def compare(
    drive: DriveFile,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", file_okay=False, help="Folder for compare.html and teaching.html, pages with plots."
        ),
    ] = None,
    controllers: Annotated[
        list[str] | None, typer.Option("--controllers", "-c", help="Names, comma-separated or repeated; default: all.")
    ] = None,
    agents: Annotated[
        list[str] | None,
        typer.Option(
            "--agents",
            "-a",
            help="Trained agents: names or policy files (.npz), comma-separated or repeated; none for none; default: all "
            "ready-trained ones.",
        ),
    ] = None,
    periods: Annotated[
        str, typer.Option(help="Sample times for which controllers are designed [ms], comma-separated.")
    ] = "1,5",
    references: Annotated[
        list[str] | None,
        typer.Option(
            "--references",
            "-r",
            help="Beside the handout's trajectory: name or name:keyword=value, comma-separated or repeated; none for none; "
            "default: s_curve, square, sine, chirp, prbs.",
        ),
    ] = None,
    draws: Annotated[
        int | None, typer.Option(min=0, max=20_000, help="Drives drawn from the covariance; default: 500.")
    ] = None,
    effects: Annotated[
        bool, typer.Option(help="Also run every left-out effect of the catalogue at its typical size.")
    ] = True,
    duration: Annotated[float, typer.Option(min=0.5, max=600.0, help="Of a run along a reference [s].")] = 4.0,
    limit: Annotated[
        float, typer.Option(min=0.1, max=1000.0, help="Of the command [V]; never more than the drive's own.")
    ] = 8.0,
    tolerance: Annotated[float, typer.Option(min=0.001, max=1000.0, help="For settling and success [mm].")] = 2.0,
    empirical: Annotated[bool, typer.Option(help="Also find margins by trial.")] = True,
    seed: Annotated[int, typer.Option(min=0, max=MOST_SEED, help="Of the draws.")] = 0,
    backend: Annotated[
        Backend, typer.Option(help="Where runs are computed; the answer does not change.")
    ] = Backend.threading,
    jobs: Annotated[
        int,
        typer.Option(
            min=-1, max=MOST_THREADS, callback=jobs_given, help="Workers of this machine; -1: as many as cores."
        ),
    ] = -1,
    scheduler: Annotated[str | None, typer.Option(help="Address of a Dask scheduler, tcp://HOST:PORT.")] = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Compare controllers and trained agents on the drive, on drives drawn from its covariance, and with left-out effects."""
    from baselines import compare as comparing  # noqa: PLC0415
    from flexdrive_gym import load_drive  # noqa: PLC0415

    rig = load_drive(drive)
    learnt = comparing.agent_entries(rig, _names(agents))
    named = _names(references)
    along = tuple(comparing.named_reference(name) for name in (comparing.UNSEEN if named is None else named))
    remarks = []
    if draws is None:
        draws = comparing.DRAWS if rig.covariance is not None else 0
        if not draws:
            remarks.append("the drive has no covariance, so no drives are drawn; identify it with --method ml")
    cases = comparing.cases_of(rig, draws=draws, effects=effects, references=along, seed=seed)
    with ExitStack() as held:
        held.enter_context(interrupted_says(lambda: _KEPT))
        if output is not None:
            held.enter_context(result_folder(output, "compare.html", force=force))
        bar = held.enter_context(progress())
        task = bar.add_task("designing", total=None)
        chosen, skipped = comparing.entries(rig, _names(controllers) or (), limit=limit, periods=_seconds(periods))
        everyone = [*chosen, *comparing.previewed_entries(rig, chosen, learnt), *learnt]
        bar.update(task, description="comparing")
        result = comparing.compare(
            rig, everyone, cases=cases, duration=duration, limit=limit, tolerance=tolerance, empirical=empirical, seed=seed,
            backend=backend.value, jobs=jobs, scheduler=scheduler, skipped=skipped,
            progress=lambda done, total: bar.update(task, completed=done, total=total),
        )  # fmt: skip
        bar.update(task, description="summing up")
        summaries, improvements = comparing.summarise(result)
        bar.update(task, description="drawing")
        pages = [] if output is None else _write(result, output)
    if json:
        print_json(
            _as_json(result)
            | {"groups": {s.name: s for s in summaries}, "improvements": improvements, "notes": remarks, "pages": pages}
        )
        return
    _print(result, summaries, improvements)
    for remark in remarks:
        say(f"note: {remark}")
    for page in pages:
        say(f"wrote {page}")


def _names(given: list[str] | None) -> list[str] | None:
    """Return names from repeated and comma-separated options; ``none`` is an empty list."""
    if given is None:
        return None
    names = [name.strip() for item in given for name in item.split(",") if name.strip()]
    return [] if names == ["none"] else names


def _seconds(periods: str) -> list[float]:
    """Return sample times [s] from a list in milliseconds, each a whole number of the rig's."""
    found = []
    for item in periods.split(","):
        try:
            value = float(item)
        except ValueError:
            value = 0.0
        if not 1.0 <= value <= _LONGEST_MS or abs(value - round(value)) > 1e-9:
            raise ValueError(
                f"periods: must be whole milliseconds from 1 to {_LONGEST_MS}; got {item!r}. Try --periods 1,5."
            )
        found.append(1e-3 * round(value))
    return list(dict.fromkeys(found))


def _write(result: Comparison, output: Path) -> list[Path]:
    from baselines.report.compare_page import build_compare_page  # noqa: PLC0415
    from baselines.report.teaching_page import build_teaching_page  # noqa: PLC0415
    from flexdrive_gym.files import write_atomically  # noqa: PLC0415

    pages = {"compare.html": build_compare_page(result)}
    if result.drive.carts == 2:
        pages["teaching.html"] = build_teaching_page(result)
    return [write_atomically(output / name, page.encode()) for name, page in pages.items()]


def _as_json(result: Comparison) -> dict[str, object]:
    groups = ("nominal", "draw", "effect")
    return {
        "drive": result.drive.name,
        "limit_V": result.limit,
        "tolerance_mm": result.tolerance,
        "duration_s": result.duration,
        "seed": result.seed,
        "references": result.references,
        "cases": {group: sum(c.group == group and c.handout for c in result.cases) for group in groups}
        | {"unseen": sum(not c.handout for c in result.cases)},
        "controllers": {
            r.entry.name: {
                "title": r.entry.title,
                "feedback": r.entry.feedback,
                "period_s": r.entry.period,
                "learnt": r.entry.learnt,
                "group": r.entry.group,
                "notes": r.entry.notes,
                "nominal": r.nominal,
                "margins": r.margins,
                "empirical_margins": r.empirical,
                "margins_on_rig": r.on_rig,
                "draws": {"success": r.draws, "stable": r.stable_draws, "rms_mm_quantiles": r.draw_rms},
                "effects": r.effects,
                "unseen": r.unseen,
            }
            for r in result.results
        },
        "skipped": result.skipped,
    }


def _print(result: Comparison, summaries: Sequence[Summary], improvements: Sequence[Improvement]) -> None:
    from baselines.compare import headline, learnt_verdicts  # noqa: PLC0415
    from baselines.report.compare_page import share_cell  # noqa: PLC0415

    table(
        f"tracking on “{result.drive.name}”, ±{min(result.limit, result.drive.voltage_limit):g} V",
        ["controller", "reads", "rms e [mm]", "peak [mm]", "settling [s]", "overshoot [%]", "vibration [V mm]", "rms u [V]",
         "peak u [V]"],
        [
            [r.entry.name, r.entry.feedback, number(m.rms, 3), number(m.peak, 3), number(m.settling, 2), number(m.overshoot, 2),
             number(m.vibration, 2), number(m.effort, 3), number(m.effort_peak, 3)]
            for r in result.results for m in [r.nominal]
        ],
    )  # fmt: skip
    table(
        "margins of the sampled linear loop (in brackets: by trial), and by trial on the rig with friction and limit",
        ["controller", "GM", "PM [deg]", "delay [ms]", "disk", "peak |S|", "rejection [V/mm]", "GM, rig", "delay, rig [ms]"],
        [
            [r.entry.name, _pair(None if m is None else m.gain_margin, None if e is None else e.gain_margin),
             number(None if m is None else m.phase_margin_deg, 3),
             _pair(None if m is None else 1e3 * m.delay_margin, None if e is None else 1e3 * e.delay_margin),
             number(None if m is None else m.disk_margin, 2), number(None if m is None else m.sensitivity_peak, 3),
             number(None if m is None else m.stiffness, 3), number(None if f is None else f.gain_margin, 4),
             number(None if f is None else 1e3 * f.delay_margin, 4)]
            for r in result.results for m, e, f in [(r.margins, r.empirical, r.on_rig)]
        ],
    )  # fmt: skip
    table(
        "robustness",
        ["controller", "stable over draws", "success over draws", "rms e, 5 … 95 % [mm]", "effects survived"],
        [
            [r.entry.name, share_cell(r.stable_draws), share_cell(r.draws),
             "–" if r.draw_rms is None else f"{r.draw_rms[0]:.3g} … {r.draw_rms[2]:.3g}",
             "–" if r.effect_share is None else f"{r.effect_share.hits} of {r.effect_share.trials}"]
            for r in result.results
        ],
    )  # fmt: skip
    if any(r.entry.learnt for r in result.results):
        table(
            "rms e along each reference [mm]: interquartile means, and 95 % intervals over training seeds and drives",
            ["group", "seeds", "handout", "failures", *result.references],
            [
                [
                    s.name,
                    str(s.seeds),
                    str(s.rms),
                    s.failures.percent,
                    *(str(s.unseen[name]) for name in result.references),
                ]
                for s in summaries
            ],
        )
    for sentence in [*headline(result), *learnt_verdicts(result, summaries, improvements)]:
        say(sentence)
    for r in result.results:
        for note in r.entry.notes:
            say(f"note: {r.entry.name}: {note}")
    for name, reason in result.skipped.items():
        say(f"left out: {name}: {reason}")


def _pair(analytic: float | None, by_trial: float | None) -> str:
    return number(analytic, 4) + ("" if by_trial is None else f" ({number(by_trial, 4)})")

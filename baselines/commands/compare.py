"""``flexdrive compare``."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from baselines.commands._output import DriveFile, Json, number, print_json, progress, say, table

if TYPE_CHECKING:
    from baselines.compare import Comparison


class Backend(StrEnum):
    """Where runs are computed."""

    threading = "threading"
    loky = "loky"
    dask = "dask"
    sequential = "sequential"


def compare(
    drive: DriveFile,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", file_okay=False, help="Folder for compare.html, a page with plots.")
    ] = None,
    controllers: Annotated[
        list[str] | None, typer.Option("--controllers", "-c", help="Names, comma-separated or repeated; default: all.")
    ] = None,
    draws: Annotated[int | None, typer.Option(min=0, help="Drives drawn from the covariance; default: 500.")] = None,
    effects: Annotated[
        bool, typer.Option(help="Also run every left-out effect of the catalogue at its typical size.")
    ] = True,
    duration: Annotated[float, typer.Option(min=0.5, help="Of a run on the handout's trajectory [s].")] = 4.0,
    limit: Annotated[float, typer.Option(min=0.1, help="Of the command [V]; never more than the drive's own.")] = 8.0,
    tolerance: Annotated[float, typer.Option(min=0.001, help="For settling and success [mm].")] = 2.0,
    empirical: Annotated[bool, typer.Option(help="Also find margins by trial.")] = True,
    seed: Annotated[int, typer.Option(min=0, help="Of the draws.")] = 0,
    backend: Annotated[
        Backend, typer.Option(help="Where runs are computed; the answer does not change.")
    ] = Backend.threading,
    jobs: Annotated[int, typer.Option(help="Workers of this machine; -1: as many as cores.")] = -1,
    scheduler: Annotated[str | None, typer.Option(help="Address of a Dask scheduler, tcp://HOST:PORT.")] = None,
    json: Json = False,
) -> None:
    """Compare controllers on the drive, on drives drawn from its covariance, and with each left-out effect."""
    from baselines import compare as comparing  # noqa: PLC0415
    from flexdrive_gym import load_drive  # noqa: PLC0415

    rig = load_drive(drive)
    names = [name.strip() for item in controllers or [] for name in item.split(",") if name.strip()]
    chosen, skipped = comparing.entries(rig, names, limit=limit)
    remarks = []
    if draws is None:
        draws = comparing.DRAWS if rig.covariance is not None else 0
        if not draws:
            remarks.append("the drive has no covariance, so no drives are drawn; identify it with --method ml")
    cases = comparing.cases_of(rig, draws=draws, effects=effects, seed=seed)
    with progress() as bar:
        task = bar.add_task("comparing", total=None)
        result = comparing.compare(
            rig, chosen, cases=cases, duration=duration, limit=limit, tolerance=tolerance, empirical=empirical, seed=seed,
            backend=backend.value, jobs=jobs, scheduler=scheduler, skipped=skipped,
            progress=lambda done, total: bar.update(task, completed=done, total=total),
        )  # fmt: skip
    page = None
    if output is not None:
        from baselines.report.compare_page import build_compare_page  # noqa: PLC0415
        from flexdrive_gym.files import write_atomically  # noqa: PLC0415

        page = write_atomically(output / "compare.html", build_compare_page(result).encode())
    if json:
        print_json(_as_json(result) | {"notes": remarks, "page": page})
        return
    _print(result)
    for remark in remarks:
        say(f"note: {remark}")
    if page is not None:
        say(f"wrote {page}")


def _as_json(result: Comparison) -> dict[str, object]:
    return {
        "drive": result.drive.name,
        "limit_V": result.limit,
        "tolerance_mm": result.tolerance,
        "duration_s": result.duration,
        "seed": result.seed,
        "cases": {group: sum(c.group == group for c in result.cases) for group in ("nominal", "draw", "effect")},
        "controllers": {
            r.entry.name: {
                "title": r.entry.title,
                "feedback": r.entry.feedback,
                "notes": r.entry.notes,
                "nominal": r.nominal,
                "margins": r.margins,
                "empirical_margins": r.empirical,
                "draws": {"success": r.draws, "stable": r.stable_draws, "rms_mm_quantiles": r.draw_rms},
                "effects": r.effects,
            }
            for r in result.results
        },
        "skipped": result.skipped,
    }


def _print(result: Comparison) -> None:
    from baselines.compare import headline  # noqa: PLC0415
    from baselines.report.compare_page import share_cell  # noqa: PLC0415

    table(
        f"tracking on {result.drive.name}, ±{min(result.limit, result.drive.voltage_limit):g} V",
        ["controller", "reads", "rms e [mm]", "peak [mm]", "settling [s]", "overshoot [%]", "vibration [V mm]", "rms u [V]",
         "peak u [V]"],
        [
            [r.entry.name, r.entry.feedback, number(m.rms, 3), number(m.peak, 3), number(m.settling, 2), number(m.overshoot, 2),
             number(m.vibration, 2), number(m.effort, 3), number(m.effort_peak, 3)]
            for r in result.results for m in [r.nominal]
        ],
    )  # fmt: skip
    table(
        "margins of the sampled linear loop (in brackets: by trial)",
        ["controller", "GM", "PM [deg]", "delay [ms]", "disk", "peak |S|", "rejection [V/mm]"],
        [
            [r.entry.name, _pair(None if m is None else m.gain_margin, None if e is None else e.gain_margin),
             number(None if m is None else m.phase_margin_deg, 3),
             _pair(None if m is None else 1e3 * m.delay_margin, None if e is None else 1e3 * e.delay_margin),
             number(None if m is None else m.disk_margin, 2), number(None if m is None else m.sensitivity_peak, 3),
             number(None if m is None else m.stiffness, 3)]
            for r in result.results for m, e in [(r.margins, r.empirical)]
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
    for sentence in headline(result):
        say(sentence)
    for r in result.results:
        for note in r.entry.notes:
            say(f"note: {r.entry.name}: {note}")
    for name, reason in result.skipped.items():
        say(f"left out: {name}: {reason}")


def _pair(analytic: float | None, by_trial: float | None) -> str:
    return number(analytic, 4) + ("" if by_trial is None else f" ({number(by_trial, 4)})")

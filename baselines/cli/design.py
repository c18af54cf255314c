"""``flexdrive design``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from baselines.cli._output import DriveFile, Json, number, print_json, say, table

if TYPE_CHECKING:
    from baselines.lab.lab4_study import Lab4Study
    from baselines.lab.uncertainty import LoopUncertainty


def design(
    drive: DriveFile,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", file_okay=False, help="Folder for design.html, a page with plots.")
    ] = None,
    crossover: Annotated[float, typer.Option(min=0.1, max=3000.0, help="Demanded crossover [rad/s].")] = 25.0,
    gain_margin: Annotated[float, typer.Option(min=1.0, max=1000.0, help="Least gain margin.")] = 2.0,
    phase_margin: Annotated[float, typer.Option(min=1.0, max=89.0, help="Least phase margin [deg].")] = 30.0,
    limit: Annotated[
        list[float] | None,
        typer.Option(min=0.1, max=1000.0, help="Command limit of the tracking runs [V]; repeatable."),
    ] = None,
    json: Json = False,
) -> None:
    """Design Lab 4's controller for the drive: notch, double lead, integral, feed-forward; print every value."""
    from baselines.controllers import Specification  # noqa: PLC0415
    from baselines.lab.lab4_study import LIMITS_V, study_lab_4  # noqa: PLC0415
    from baselines.lab.uncertainty import loop_uncertainty  # noqa: PLC0415
    from flexdrive_gym import load_drive  # noqa: PLC0415

    rig = load_drive(drive)
    if rig.units.scale:
        typer.echo(f"note: {rig.units.scale}", err=True)
    asked = Specification(crossover=crossover, gain_margin=gain_margin, phase_margin_deg=phase_margin)
    study = study_lab_4(rig, specification=asked, limits=tuple(limit or LIMITS_V))
    spread = loop_uncertainty(rig, study.stages[-1].design.controller)
    page = None
    if output is not None:
        from baselines.report.design_page import build_design_page  # noqa: PLC0415
        from flexdrive_gym.files import write_atomically  # noqa: PLC0415

        page = write_atomically(output / "design.html", build_design_page(study).encode())
    if json:
        print_json(_as_json(study) | {"uncertainty": spread, "page": page})
        return
    _print(study)
    if spread is not None:
        say(_in_words(spread))
    if page is not None:
        say(f"wrote {page}")


def _in_words(spread: LoopUncertainty) -> str:
    titles = {"crossover": "crossover {} rad/s", "gain_margin": "GM {}", "phase_margin_deg": "PM {}°"}
    intervals = [titles[name].format(f"{low:.3g} … {high:.3g}") for name, (low, high) in spread.ci95.items()]
    return (
        f"on {spread.draws} drives drawn from the covariance the last stage is unstable on {spread.unstable:.0%}; "
        f"95 % of the others: {', '.join(intervals) or '–'}"
    )


def _as_json(study: Lab4Study) -> dict[str, object]:
    return {
        "specification": study.specification,
        "by_the_handout": {
            "values": {k: {"value": v, "unit": u} for k, (v, u) in study.by_hand.table().items()},
            "margins": study.hand_margins,
            "lines": study.hand_lines,
        },
        "refined": {
            "values": {k: {"value": v, "unit": u} for k, (v, u) in study.refined.table().items()},
            "met": study.met,
            "lines": study.lines,
        },
        "stages": {
            s.name: {
                "title": s.design.title,
                "notes": s.design.notes,
                "margins": s.margins,
                "step": s.step,
                "disturbance": s.disturbance,
                "disturbance_with_friction": s.rig_disturbance,
                "step_with_friction": {f"{limit:g} V": r for limit, r in s.rig_steps.items()},
                "tracking": {f"{limit:g} V": m for limit, m in s.tracking.items()},
            }
            for s in study.stages
        },
    }


def _print(study: Lab4Study) -> None:
    from baselines.compare.tables import LINEAR  # noqa: PLC0415
    from baselines.lab.lab4_study import verdict  # noqa: PLC0415

    hand, refined = study.by_hand.table(), study.refined.table()
    table(
        f"Lab 4 on {study.drive.name}: values of the design",
        ["value", "unit", "by the handout", "refined on the sampled loop"],
        [[name, unit, number(value), number(refined[name][0])] for name, (value, unit) in hand.items()],
    )
    table(
        "specification",
        ["line", "demanded", "handout's rule reaches", "refined reaches", "missed by"],
        [
            [
                line.name,
                line.demand,
                by_hand.reached + ("" if by_hand.met else " (missed)"),
                line.reached,
                line.missed_by,
            ]
            for line, by_hand in zip(study.lines, study.hand_lines, strict=False)
        ],
    )
    for sentence in verdict(study):
        say(sentence)
    table(
        "stages on the sampled linear loop",
        ["stage", "linear loop", "crossover [rad/s]", "GM linear", "PM linear [deg]", "delay linear [ms]", "disk margin",
         "peak |S|", "rise [s]", "overshoot [%]", "1 V: peak [mm]", "1 V: final [mm]"],
        [
            [s.name, "stable" if s.margins.stable else "unstable", number(s.margins.crossover), number(s.margins.gain_margin, 3),
             number(s.margins.phase_margin_deg, 3), number(1e3 * s.margins.delay_margin, 3),
             number(s.margins.disk_margin, 2), number(s.margins.sensitivity_peak, 3), number(s.step.rise, 3),
             number(s.step.overshoot, 3), number(s.disturbance.peak, 3), number(round(s.disturbance.final, 3), 3)]
            for s in study.stages
        ],
    )  # fmt: skip
    say(LINEAR)
    table(
        "tracking of the handout's trajectory, simulated with friction and encoder counts",
        ["stage", "limit [V]", "rms xr - x2 [mm]", "peak [mm]", "settling [s]", "overshoot [%]", "rms u [V]", "peak u [V]",
         "at the limit", "10 mm step: rise [s]", "overshoot [%]"],
        [
            [s.name, number(limit), number(m.rms, 3), number(m.peak, 3), number(m.settling, 2), number(m.overshoot, 2),
             number(m.effort, 3), number(m.effort_peak, 3), f"{m.limited:.0%}", number(s.rig_steps[limit].rise, 2),
             number(s.rig_steps[limit].overshoot, 3)]
            for s in study.stages for limit, m in s.tracking.items()
        ],
    )  # fmt: skip
    say("settling: longest time after a move until x2 stays within 2 mm; – : it never does before the next move")

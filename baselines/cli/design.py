"""``flexdrive design``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from baselines.cli._command import positive
from baselines.cli._output import DriveFile, Json, number, print_json, say, table

if TYPE_CHECKING:
    from baselines.controllers.loop_shaping import Lab4
    from baselines.lab.lab4_study import Lab4Study
    from baselines.lab.uncertainty import LoopUncertainty
    from flexdrive_gym.units import Units


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
        typer.Option(
            min=0.0,
            max=1e9,
            callback=positive,
            help="Command limit of the tracking runs [V, or the rig's]; repeatable; default: 4 and 8 V, or half and all of what "
            "the rig's recordings reached.",
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Design Lab 4's controller for the drive: notch, double lead, integral, feed-forward; print every value."""
    from baselines.controllers import Specification  # noqa: PLC0415
    from baselines.lab.lab4_study import study_lab_4  # noqa: PLC0415
    from baselines.lab.lab_scale import on_lab_scale  # noqa: PLC0415
    from baselines.lab.uncertainty import loop_uncertainty  # noqa: PLC0415
    from flexdrive_gym import load_drive  # noqa: PLC0415

    rig = on_lab_scale(load_drive(drive))
    units = rig.units
    asked = Specification(units.to_engine(crossover, "rad/s"), gain_margin, phase_margin)
    limits = [units.to_engine(value, "V") for value in limit] if limit else None
    study = study_lab_4(rig, specification=asked, limits=limits)
    spread = loop_uncertainty(rig, study.stages[-1].design.controller)
    page = None
    if output is not None:
        from baselines.report.design_page import build_design_page  # noqa: PLC0415
        from flexdrive_gym.files import write_atomically  # noqa: PLC0415

        page = write_atomically(output / "design.html", build_design_page(study).encode())
    if json:
        print_json(_as_json(study, units) | {"uncertainty": spread, "page": page})
        return
    _print(study, units)
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


def _values(values: Lab4, units: Units) -> dict[str, tuple[float, str]]:
    """Return symbol to value and unit, as the rig's owner reads them."""
    return {name: units.of_rig(value, unit) for name, (value, unit) in values.table().items()}


def _as_json(engine: Lab4Study, units: Units) -> dict[str, object]:
    from flexdrive_gym.units import in_rig_units  # noqa: PLC0415

    by_hand, refined, study = (
        _values(engine.by_hand, units),
        _values(engine.refined, units),
        in_rig_units(engine, units),
    )
    return {
        "units": {"length": units.length, "command": units.command},
        "specification": study.specification,
        "by_the_handout": {
            "values": {k: {"value": v, "unit": u} for k, (v, u) in by_hand.items()},
            "margins": study.hand_margins,
            "lines": study.hand_lines,
        },
        "refined": {
            "values": {k: {"value": v, "unit": u} for k, (v, u) in refined.items()},
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
                "step_with_friction": {f"{limit:.4g} {units.command}": r for limit, r in s.rig_steps.items()},
                "tracking": {f"{limit:.4g} {units.command}": m for limit, m in s.tracking.items()},
            }
            for s in study.stages
        },
    }


def _print(engine: Lab4Study, units: Units) -> None:
    from baselines.compare.tables import LINEAR  # noqa: PLC0415
    from baselines.evaluation.metrics import TOLERANCE_MM  # noqa: PLC0415
    from baselines.lab.lab4_study import DISTURBANCE_V, STEP_MM, verdict  # noqa: PLC0415
    from flexdrive_gym.units import in_rig_units  # noqa: PLC0415

    hand, refined, study = _values(engine.by_hand, units), _values(engine.refined, units), in_rig_units(engine, units)
    pushed = units.text(DISTURBANCE_V, "V")
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
    for sentence in verdict(engine):
        say(sentence)
    table(
        "stages on the sampled linear loop",
        ["stage", "linear loop", "crossover [rad/s]", "GM linear", "PM linear [deg]", "delay linear [ms]", "disk margin",
         "peak |S|", "rise [s]", "overshoot [%]", units.label(f"{pushed}: peak [mm]"), units.label(f"{pushed}: final [mm]")],
        [
            [s.name, "stable" if s.margins.stable else "unstable", number(s.margins.crossover), number(s.margins.gain_margin, 3),
             number(s.margins.phase_margin_deg, 3), number(1e3 * s.margins.delay_margin, 3),
             number(s.margins.disk_margin, 2), number(s.margins.sensitivity_peak, 3), number(s.step.rise, 3),
             number(s.step.overshoot, 3), number(s.disturbance.peak, 3), number(_small(s.disturbance.final, units), 3)]
            for s in study.stages
        ],
    )  # fmt: skip
    say(LINEAR)
    table(
        "tracking of the handout's trajectory, simulated with friction and encoder counts",
        [*map(units.label, ("stage", "limit [V]", "rms xr - x2 [mm]", "peak [mm]", "settling [s]", "overshoot [%]", "rms u [V]",
                            "peak u [V]", "at the limit", f"{units.text(STEP_MM, 'mm')} step: rise [s]", "overshoot [%]"))],
        [
            [s.name, number(limit), number(m.rms, 3), number(m.peak, 3), number(m.settling, 2), number(m.overshoot, 2),
             number(m.effort, 3), number(m.effort_peak, 3), f"{m.limited:.0%}", number(s.rig_steps[limit].rise, 2),
             number(s.rig_steps[limit].overshoot, 3)]
            for s in study.stages for limit, m in s.tracking.items()
        ],
    )  # fmt: skip
    say(
        "settling: longest time after a move until x2 stays within "
        f"{units.text(TOLERANCE_MM, 'mm')}; – : it never does before the next move"
    )


def _small(value: float, units: Units) -> float:
    """Return a rest that a linear loop leaves, without the round-off below a micrometre of the lab."""
    least = 1e-3 / units.one("mm")
    return round(value / least) * least

"""``flexdrive stability``."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from baselines.cli._output import DriveFile, Json, number, print_json, say, table

if TYPE_CHECKING:
    from baselines.lab.stability_study import StabilityStudy
    from flexdrive_gym.units import Units


def stability(
    drive: DriveFile,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            file_okay=False,
            help="Folder for stability.html and the recordings of 2.1-2.4, with and without friction.",
        ),
    ] = None,
    gain: Annotated[
        float | None,
        typer.Option(
            min=0.0, max=1e9, help="Kp at which the phase margin is stated [V/mm, or the rig's]; default: 0.05 V/mm."
        ),
    ] = None,
    draws: Annotated[
        int, typer.Option(min=0, max=100_000, help="Drives drawn from the covariance, for intervals; 0 for none.")
    ] = 100,
    json: Json = False,
) -> None:
    """Print the critical gain of P-control, linear, simulated and as a student finds it, from x1 and from x2."""
    from baselines.lab.experiments import STABLE_GAIN  # noqa: PLC0415
    from baselines.lab.lab_scale import on_lab_scale  # noqa: PLC0415
    from baselines.lab.stability_study import study_stability  # noqa: PLC0415
    from flexdrive_gym import load_drive  # noqa: PLC0415

    rig = on_lab_scale(load_drive(drive))
    at = STABLE_GAIN if gain is None else gain * rig.units.one("V/mm")
    study = study_stability(rig, at, draws)
    written = [] if output is None else _write(study, output)
    if json:
        print_json({**_as_json(study), "written": written})
        return
    _print(study, at)
    for path in written:
        say(f"wrote {path}")


def _write(study: StabilityStudy, output: Path) -> list[Path]:
    """Write the page and the recordings of 2.1-2.4; return their paths."""
    from baselines.report.stability_page import build_stability_page  # noqa: PLC0415
    from flexdrive_gym.files import write_atomically  # noqa: PLC0415
    from identification import write_recording, write_rig  # noqa: PLC0415

    rig, written = study.drive, []
    for folder, runs in (("with_friction", study.runs), ("without_friction", study.runs_without_friction)):
        for run in runs.values():
            path = output / folder / f"{run.name}.csv"
            write_recording(run, path)
            written.append(path)
        if not rig.units.lab:
            written.append(write_rig(rig.units, rig.carts, output / folder / "rig.toml", rig.name))
    return [*written, write_atomically(output / "stability.html", build_stability_page(study).encode())]


def _as_json(study: StabilityStudy) -> dict[str, object]:
    """Return the study in the rig's units as one object."""
    from flexdrive_gym.units import in_rig_units  # noqa: PLC0415

    units, one = study.drive.units, study.drive.units.one("V/mm")
    limits = {
        k: {**asdict(v), "unit": units.name("V/mm"), **_uncertainty(study, k)}
        for k, v in in_rig_units(study.limits, units).items()
    }
    if "x2" in limits:
        limits["x2"] |= {
            "critical_gain_student": _over(study.student, one),
            "critical_gain_student_ci95": study.predicted["critical_gain_x2_trajectory"].of_rig(units).ci95,
            "critical_gain_student_without_friction": _over(study.student_without_friction, one),
        }
    return {
        **limits,
        "explanation": " ".join(study.explanation),
        "predictions": [asdict(p.of_rig(units)) for p in study.predicted.values()],
        "amplitude": [
            {**_amplitude(s.amplitude, units), "critical_gain": s.factor / one, "omega": s.omega / units.one("Hz")}
            for s in study.curve
        ],
        "amplitude_simulated": [{**_amplitude(s.amplitude, units), "critical_gain": kp / one} for s, kp in study.tried],
    }


def _print(study: StabilityStudy, at: float) -> None:
    """Print the limits with phase margins ``at`` a gain [V/mm], their uncertainty, amplitudes and what explains them."""
    from baselines.loop_analysis.stability_limit import LARGEST_GAIN  # noqa: PLC0415
    from flexdrive_gym.units import in_rig_units  # noqa: PLC0415

    units, one = study.drive.units, study.drive.units.one("V/mm")
    table(
        f"critical gain of P-control of “{study.drive.name}”",
        [
            "feedback",
            units.name("Routh, linear [V/mm]"),
            units.name("gain margin, linear [V/mm]"),
            units.name("simulated with friction [V/mm]"),
            "vibration, linear [rad/s]",
            f"PM linear at {units.text(at, 'V/mm')} [deg]",
        ],
        [
            [
                name,
                number(v.critical_gain_linear, 5),
                number(v.critical_gain_margin, 5),
                number(v.critical_gain_simulated, 5),
                number(v.vibration),
                number(v.phase_margin_deg, 4),
            ]
            for name, v in in_rig_units(study.limits, units).items()
        ],
    )
    say(f"– : no limit below {units.text(LARGEST_GAIN, 'V/mm')}")
    _print_uncertainty(study)
    if study.tried:
        table(
            units.name("gain from x2 at which a vibration keeps its size [V/mm]"),
            [units.name("amplitude of x2 [mm]"), "harmonic balance", "simulated"],
            [
                [number(s.amplitude / units.one("mm"), 3), number(s.factor / one), number(kp / one)]
                for s, kp in study.tried
            ],
        )
    for sentence in study.explanation:
        say(sentence)


def _over(value: float | None, one: float) -> float | None:
    return None if value is None else value / one


def _amplitude(value: float, units: Units) -> dict[str, object]:
    """Return the amplitude of x2 with its unit; the lab's is part of the key's name, from before there were others."""
    if units.lab:
        return {"amplitude_mm": value}
    return {"amplitude": value / units.one("mm"), "unit": units.length}


def _uncertainty(study: StabilityStudy, feedback: str) -> dict[str, object]:
    units = study.drive.units
    linear, simulated = (
        study.predicted[f"critical_gain_{feedback}_{kind}"].of_rig(units) for kind in ("linear", "simulated")
    )
    return {
        "critical_gain_linear_ci95": linear.ci95,
        "critical_gain_simulated_ci95": simulated.ci95,
        "extrapolated": simulated.extrapolated,
    }


def _print_uncertainty(study: StabilityStudy) -> None:
    from baselines.lab.uncertainty import PREDICTION_COLUMNS, prediction_rows, reasons  # noqa: PLC0415

    units = study.drive.units

    if study.drive.covariance is None:
        say("no intervals: the drive has no covariance; identify it with --method ml")
        return
    rows = prediction_rows(study.predicted.values(), units)
    if not rows:
        return
    table("predicted for another run of this rig", list(PREDICTION_COLUMNS), [list(row) for row in rows])
    for sentence in reasons(study.predicted.values(), units):
        say(sentence)

"""``flexdrive stability``."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from baselines.commands._output import DriveFile, Json, number, print_json, say, table

if TYPE_CHECKING:
    from baselines.stability_study import StabilityStudy


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
        float, typer.Option(min=0.0, max=1000.0, help="Kp at which the phase margin is stated [V/mm].")
    ] = 0.05,
    draws: Annotated[
        int, typer.Option(min=0, max=100_000, help="Drives drawn from the covariance, for intervals; 0 for none.")
    ] = 100,
    json: Json = False,
) -> None:
    """Print the critical gain of P-control, linear, simulated and as a student finds it, from x1 and from x2."""
    from baselines.stability_study import study_stability  # noqa: PLC0415
    from flexdrive_gym import load_drive  # noqa: PLC0415

    rig = load_drive(drive)
    study = study_stability(rig, gain, draws)
    written = []
    if output is not None:
        from baselines.report.stability_page import build_stability_page  # noqa: PLC0415
        from flexdrive_gym.files import write_atomically  # noqa: PLC0415
        from identification import write_recording  # noqa: PLC0415

        for folder, runs in (("with_friction", study.runs), ("without_friction", study.runs_without_friction)):
            for run in runs.values():
                path = output / folder / f"{run.name}.csv"
                write_recording(run, path)
                written.append(path)
        written.append(write_atomically(output / "stability.html", build_stability_page(study).encode()))
    if json:
        limits = {k: {**asdict(v), "unit": "V/mm", **_uncertainty(study, k)} for k, v in study.limits.items()}
        if "x2" in limits:
            limits["x2"] |= {
                "critical_gain_student": study.student,
                "critical_gain_student_ci95": study.predicted["critical_gain_x2_trajectory"].ci95,
                "critical_gain_student_without_friction": study.student_without_friction,
            }
        print_json({
            **limits,
            "explanation": " ".join(study.explanation),
            "predictions": [asdict(p) for p in study.predicted.values()],
            "amplitude": [
                {"amplitude_mm": s.amplitude, "critical_gain": s.factor, "omega": s.omega} for s in study.curve
            ],
            "amplitude_simulated": [{"amplitude_mm": s.amplitude, "critical_gain": kp} for s, kp in study.tried],
            "written": written,
        })  # fmt: skip
        return
    table(
        f"critical gain of P-control of “{rig.name}”",
        [
            "feedback",
            "Routh, linear [V/mm]",
            "gain margin, linear [V/mm]",
            "simulated with friction [V/mm]",
            "vibration, linear [rad/s]",
            f"PM linear at {gain:g} V/mm [deg]",
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
            for name, v in study.limits.items()
        ],
    )
    say("– : no limit below 10 V/mm")
    _print_uncertainty(study)
    if study.tried:
        table(
            "gain from x2 at which a vibration keeps its size [V/mm]",
            ["amplitude of x2 [mm]", "harmonic balance", "simulated"],
            [[number(s.amplitude, 3), number(s.factor), number(kp)] for s, kp in study.tried],
        )
    for sentence in study.explanation:
        say(sentence)
    for path in written:
        say(f"wrote {path}")


def _uncertainty(study: StabilityStudy, feedback: str) -> dict[str, object]:
    linear, simulated = (study.predicted[f"critical_gain_{feedback}_{kind}"] for kind in ("linear", "simulated"))
    return {
        "critical_gain_linear_ci95": linear.ci95,
        "critical_gain_simulated_ci95": simulated.ci95,
        "extrapolated": simulated.extrapolated,
    }


def _print_uncertainty(study: StabilityStudy) -> None:
    from baselines.uncertainty import interval_in_words, reasons  # noqa: PLC0415

    if study.drive.covariance is None:
        say("no intervals: the drive has no covariance; identify it with --method ml")
        return
    if not any(p.draws for p in study.predicted.values()):
        return
    table(
        "predicted for another run of this rig",
        ["figure", "of the drive", "median", "95 % interval", "unit", "extrapolated"],
        [
            [p.name, number(p.value), number(p.median), interval_in_words(p), p.unit, "yes" if p.extrapolated else "no"]
            for p in study.predicted.values()
            if p.draws
        ],
    )
    for sentence in reasons(study.predicted.values()):
        say(sentence)

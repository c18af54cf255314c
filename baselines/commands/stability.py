"""``flexdrive stability``."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated

import typer

from baselines.commands._output import DriveFile, Json, number, print_json, say, table


def stability(
    drive: DriveFile,
    gain: Annotated[float, typer.Option(min=0.0, help="Kp at which the phase margin is stated [V/mm].")] = 0.05,
    json: Json = False,
) -> None:
    """Print the critical gain of P-control, linear and simulated, from x1 and from x2."""
    from baselines.stability_limit import explain, stability_limit  # noqa: PLC0415
    from flexdrive_gym import load_drive  # noqa: PLC0415

    rig = load_drive(drive)
    limits = {feedback: stability_limit(rig, feedback, gain) for feedback in ("x1", "x2")[: rig.carts]}  # type: ignore[arg-type]
    sentence = explain(rig, limits["x2"]) if "x2" in limits else "A rigid drive has no limit in linear theory."
    if json:
        print_json({**{k: {**asdict(v), "unit": "V/mm"} for k, v in limits.items()}, "explanation": sentence})
        return
    table(
        f"P-control of {rig.name}",
        [
            "feedback",
            "Routh [V/mm]",
            "gain margin [V/mm]",
            "simulated [V/mm]",
            "vibration [rad/s]",
            f"PM at {gain:g} V/mm [deg]",
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
            for name, v in limits.items()
        ],
    )
    say("– : no limit below 10 V/mm")
    say(sentence)

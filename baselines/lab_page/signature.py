"""What an effect does: the force that the drive without it would miss, against velocity, deflection, command and place.

A run of the drive with the effect is taken for a measurement, and
:func:`identification.mismatch.force.missing_force.missing_force` estimates from its encoders what would have to be added to the
drive without it, as the diagnosis does with recordings.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from baselines.lab.experiments import SAMPLE_TIME_S
from baselines.lab_page import texts
from baselines.lab_page.chart import Axis, Chart, series
from baselines.loop_analysis.stability_limit import with_rig
from baselines.report.words import effect_name
from flexdrive_gym import Drive
from flexdrive_gym.drive.effects import EFFECTS, LAYOUT, Effect
from flexdrive_gym.references import sine
from identification.mismatch.force.missing_force import missing_force

_DURATION_S = 8.0
# what every drive has, and what the rig's own settings already hold
_LEFT_OUT = {"saturation", "encoder_quantisation", "velocity_processing", "input_delay"}
_MOST = 700


def switches() -> tuple[Effect, ...]:
    """Return the effects that have a switch: the catalogue without what every drive has and what the rig's settings hold."""
    return tuple(e for e in EFFECTS if not e.base and e.id not in _LEFT_OUT)


def plainly_present(effect: Effect, where: str) -> dict[str, float]:
    """Return an effect's parameters at one place at plainly present size: the values from which a fit starts."""
    values = {}
    for parameter in effect.parameters:
        start = parameter.starts[len(parameter.starts) // 2] if parameter.starts else parameter.null
        values[effect.key(where, parameter.name)] = float(start)
    return values


def largest(name: str) -> float:
    """Return the largest value that a slider offers for a parameter: three times plainly present, within its bounds."""
    parameter = LAYOUT[name].parameter
    top = 3.0 * max((abs(s) for s in parameter.starts), default=1.0)
    return float(min(top, parameter.upper))


def smallest(name: str) -> float:
    """Return the smallest: the same on the other side where a negative value means something, else nothing."""
    parameter = LAYOUT[name].parameter
    if parameter.role == "shape":
        return float(max(parameter.lower, 0.1 * min((abs(s) for s in parameter.starts), default=0.0)))
    return float(max(parameter.lower, -largest(name)) if parameter.lower < parameter.null else parameter.null)


def signature(drive: Drive, changes: Mapping[str, float]) -> list[Chart]:
    """Return four charts of the missing force: against velocity, deflection, command and place.

    Parameters
    ----------
    drive
        Without the effect.
    changes
        The effect's parameters.

    Raises
    ------
    ValueError
        For values that the drive refuses.
    """
    plain = with_rig(drive)
    t = np.arange(round(_DURATION_S / SAMPLE_TIME_S) + 1) * SAMPLE_TIME_S
    # a sine whose size breathes, with a little of another pitch: every speed, deflection and command is met both ways
    u = sine(t, 2.0, 0.7) * (0.75 + 0.35 * np.sin(2.0 * np.pi * 0.13 * t)) + sine(t, 1.0, 2.3)
    run = plain.replace(changes).simulate(t, u) if changes else plain.simulate(t, u)
    missing = missing_force(plain.values, run)
    units = plain.units
    length, command, speed = units.one("mm"), units.one("V"), units.one("mm/s")
    every = max(1, len(missing.t) // _MOST)
    charts = []
    against = (
        (texts.VELOCITY, units.name("mm/s"), [v / speed for v in missing.v]),
        (texts.DEFLECTION, units.length, [missing.delta / length] * len(missing.v)),
        (texts.COMMAND, units.command, [missing.u / command] * len(missing.v)),
        (texts.PLACE, units.length, [x / length for x in missing.x]),
    )
    for name, unit, values in against:
        dots = []
        for cart, x in enumerate(values):
            keep = missing.usable[cart].copy()
            keep[: len(keep) // 20] = False  # the estimator settles
            dots.append(
                series(
                    x[keep][::every],
                    (missing.g[cart] / command)[keep][::every],
                    "x1" if cart == 0 else "x2",
                    kind="dots",
                    name=texts.CART.format(number=cart + 1),
                )
            )
        largest_force = max((max((abs(v) for v in s.y if v is not None), default=0.0) for s in dots), default=0.0)
        bound = max(1.1 * largest_force, 0.05 / command)
        charts.append(
            Chart(
                texts.AGAINST.format(name=name),
                Axis(f"{name} [{unit}]"),
                Axis(f"{texts.MISSING_FORCE} [{units.command}]", -bound, bound),
                dots,
                summary=texts.SIGNATURE_SUMMARY.format(name=name, force=largest_force, unit=units.command),
            )
        )
    return charts


def title(effect: Effect) -> str:
    """Return an effect's name with a capital."""
    name = effect_name(effect.id)
    return name[0].upper() + name[1:]

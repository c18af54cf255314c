"""From a truth to what the rig's kernel reads: numbers, tables along the track, tables over time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from baselines.rig_simulator.kernel import (
    FORCE_1,
    FORCE_2,
    FRICTION_1,
    FRICTION_2,
    GAIN,
    HILL_1,
    HILL_2,
    NULLS,
    ROUGH_1,
    ROUGH_2,
    SAMPLE_S,
    TRACK_HALF_MM,
    TRACK_POINTS,
    VISCOUS_1,
    VISCOUS_2,
    FloatArray,
)
from baselines.rig_simulator.rig import Disturbances
from baselines.rig_simulator.truth import Effect, Truth


def rig_values(truth: Truth) -> dict[str, float]:
    """Return the numbers for the kernel: the drive's, and those of its effects."""
    # two effects may share a number (a motor behind a gap and behind a belt, say); the later one then rules
    concealed = {n: v for effect in truth.effects for n, v in effect.parameters.items() if n in NULLS}
    return {**truth.drive, **concealed}


def _place() -> FloatArray:
    return np.linspace(-TRACK_HALF_MM, TRACK_HALF_MM, TRACK_POINTS)


def _first(effect: Effect) -> bool:
    return effect.where == "cart_1"


def along_the_track(track: FloatArray, effects: tuple[Effect, ...]) -> FloatArray:
    """Return the track with what effects add to its friction and forces, ndarray, shape (4, TRACK_POINTS)."""
    track, x = track.copy(), _place()
    for effect in effects:
        q = effect.parameters
        if "height" in q:  # worn places
            bumps = sum(np.exp(-0.5 * ((x - q[f"at_{i}"]) / q["width"]) ** 2) for i in range(3))
            track[ROUGH_1 if _first(effect) else ROUGH_2] += q["height"] * bumps
        if "period" in q:  # poles of a motor: rounder than a triangle, sharper than a sine
            angle = 2.0 * np.pi * x / q["period"] + q["phase"]
            track[HILL_1] += q["force"] * (np.sin(angle) - 0.11 * np.sin(3.0 * angle) + 0.15 * np.sin(2.0 * angle))
        if "bow" in q:
            pull = q["bow"] * np.sinh(np.clip((x - q["centre"]) / q["bow"], -3.0, 3.0))
            track[HILL_1] -= q["stiffness_1"] * pull
            track[HILL_2] -= q["stiffness_2"] * pull
        if "bumper" in q:
            side = np.sign(q["bumper_at"])
            deep = np.maximum(0.0, side * (x - q["bumper_at"]))
            track[HILL_1 if q["bumper_cart"] == 1.0 else HILL_2] -= side * np.minimum(q["bumper"] * deep**1.5, 20.0)
        if "detent" in q:
            z = (x - q["detent_at"]) / q["detent_width"]
            track[HILL_1] -= q["detent"] * z * np.exp(0.5 - 0.5 * z**2)
    return track


def over_time(disturbances: Disturbances, truth: Truth, order: int, rng: np.random.Generator) -> Disturbances:
    """Return the disturbances with what effects do over time.

    Parameters
    ----------
    disturbances
        Of the run.
    truth
        Its effects are applied.
    order
        Place of the run in the day, 0 for the first.
    rng
        For what is random in an effect.
    """
    table = disturbances.over_time.copy()
    t: FloatArray = np.arange(table.shape[1], dtype=np.float64) * SAMPLE_S
    for effect in truth.effects:
        q = effect.parameters
        if "day" in q:
            stiff = 1.0 + q["day"] * (np.exp(-order / q["day_runs"]) - 0.4) + q["run"] * (np.exp(-t / q["run_s"]) - 0.3)
            for row in (FRICTION_1, VISCOUS_1) if _first(effect) else (FRICTION_2, VISCOUS_2):
                table[row] *= np.maximum(stiff, 0.1)
        if "loss" in q:
            table[GAIN] *= 1.0 - q["loss"] * (1.0 - np.exp(-t / q["loss_s"]))
        if "pull_1" in q:
            table[FORCE_1] += q["pull_1"]
            table[FORCE_2] += q["pull_2"]
        _outside(table, t, q, rng)
    return replace(disturbances, over_time=table)


def _outside(table: FloatArray, t: FloatArray, q: Mapping[str, float], rng: np.random.Generator) -> None:
    if "shake" in q:
        phase = float(rng.uniform(0.0, 2.0 * np.pi))
        table[FORCE_1 if q["shake_on"] == 1.0 else FORCE_2] += q["shake"] * np.sin(
            2.0 * np.pi * q["shake_hz"] * t + phase
        )
    if "blow" in q:
        for _ in range(int(rng.poisson(q["blows_hz"] * t[-1]))):
            at, side = float(rng.uniform(0.0, t[-1])), 1.0 if rng.random() < 0.5 else -1.0
            inside = (t >= at) & (t < at + q["blow_s"])
            table[FORCE_2] += side * q["blow"] * inside * np.sin(np.pi * (t - at) / q["blow_s"]) ** 2

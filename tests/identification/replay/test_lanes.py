"""Recordings in the lanes of packs give the residuals that each gives by itself, to the last bit."""

from dataclasses import replace

import numpy as np
import pytest

from flexdrive_gym.drive.effects import EFFECTS
from identification.replay.batch import RunBatch
from identification.replay.output_error import prepare
from tests.drive.drives import RIG
from tests.drive.effects.runs import start_values
from tests.each import each
from tests.identification.mismatch.lab import data_set

INSTANCES = [
    (effect, where)
    for effect in EFFECTS
    for where in effect.where
    if effect.id not in {"spring", "velocity_processing"}
]
NAMES = [f"{effect.id} {where}" for effect, where in INSTANCES]
FURTHER = {
    "delay": {"input_delay.tau": 2.5e-3, "presliding.cart_1.fd": 0.2},
    "whole delay": {"input_delay.tau": 3e-3, "hardening_spring.k3": 1e-5},
    "smooth limit": {"saturation.limit": 2.0, "saturation.softness": 0.2},
    "a rigid drive": {"m2": None, "b2": None, "d2": None, "k": None, "presliding.cart_1.fd": 0.2},
    "all at once": {
        "presliding.cart_1.fd": 0.1, "presliding.cart_2.fd": 0.1, "stribeck.cart_1.extra": 0.1, "tilt.F": 0.05,
        "extra_mode.mass_1": 5e-5, "spring_hysteresis.level": 0.1, "breakaway.cart_2.extra": 0.05,
        "base_recoil.compliance": 0.01,
    },
}  # fmt: skip


@pytest.fixture(scope="module")
def runs():
    """Recordings of several lengths; the first comes twice, once at rest and once with its track unknown in part."""
    day = [prepare(r) for r in data_set()]
    gap = day[0].track.copy()
    gap[0, 200:300] = np.nan
    return [*day, replace(day[0], u=np.zeros_like(day[0].u)), replace(day[0], track=gap)]


def by_themselves(day, values, offsets, pushes=None):
    return np.concatenate(
        [day.residual(values, offsets, i, i + 1, None if pushes is None else [pushes[i]]) for i in range(len(day.runs))]
    )


def same(day, values, pushes=None):
    offsets = np.linspace(0.0, 7.0, len(day.runs))
    together, single = day.residual(values, offsets, pushes=pushes), by_themselves(day, values, offsets, pushes)
    assert np.any(single != 0.0)
    assert np.array_equal(together, single)


@each(("effect", "where"), INSTANCES, ids=NAMES)
def test_every_effect_does_in_a_lane_what_it_does_alone(runs, effect, where):
    same(RunBatch(runs), {**RIG, **start_values(effect, where)})


@each("name", FURTHER)
def test_so_do_delays_limits_and_several_effects(runs, name):
    values = {k: v for k, v in {**RIG, **FURTHER[name]}.items() if v is not None}
    day = runs
    if "m2" not in values:
        day = [replace(run, measured=run.measured[:1], keep=run.keep[:1], floor=run.floor[:1]) for run in runs]
    same(RunBatch(day), values)


def test_so_does_a_drive_without_effects_pushed_or_not(runs):
    rng = np.random.default_rng(3)
    same(RunBatch(runs), RIG)
    same(RunBatch(runs), RIG, [0.1 * rng.standard_normal((2, len(run.u))) for run in runs])


@each("effects", [{}, {"presliding.cart_2.fd": 0.2}, {"stribeck.cart_1.extra": 0.1}])
def test_so_does_friction_of_its_own_in_every_run(runs, effects):
    rng = np.random.default_rng(4)
    drives = [{**RIG, **effects, "d1": d1, "d2": d2} for d1, d2 in rng.uniform(0.1, 0.4, (len(runs), 2))]
    pushes = [0.02 * rng.standard_normal((2, len(run.u))) for run in runs]
    day, nowhere = RunBatch(runs), np.zeros(len(runs))
    single = [day.residual([v], nowhere, i, i + 1, [pushes[i]]) for i, v in enumerate(drives)]
    assert np.array_equal(day.residual(drives, nowhere, pushes=pushes), np.concatenate(single))


def test_so_do_positions(runs):
    values = {**RIG, "coupling_backlash.g": 0.5}
    same(RunBatch([replace(run, positions=True) for run in runs]), values)


def test_what_runs_away_disturbs_no_other_lane(runs):
    values = {**RIG, "hardening_spring.k3": -2.0}
    same(RunBatch(runs), values)

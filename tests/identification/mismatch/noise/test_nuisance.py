"""What differs between recordings of any rig."""

import numpy as np
import pytest

from flexdrive_gym.units import LAB, Units
from identification.mismatch.noise.estimate import estimate
from identification.mismatch.noise.nuisance import INSTANT, WAVES_MM, directions, waves
from tests.drive.drives import RIG
from tests.identification.mismatch.lab import KINDS, bench_of, data_set


@pytest.fixture(scope="module")
def bench():
    with bench_of(data_set(kinds=KINDS[2:5])) as made:
        yield made


def test_a_command_may_fall_anywhere_within_a_sample(bench):
    (instant,) = [d for d in directions(bench, RIG) if d.group == "sampling instant"]
    assert instant.size == pytest.approx(INSTANT)
    # to first order a delay is minus the rate of the motion
    h = bench.runs[0].sample_time
    late = bench.residual({**RIG, "input_delay.tau": 0.3 * h}) - bench.residual(RIG)
    assert np.linalg.norm(late - 0.3 * instant.change) < 0.2 * np.linalg.norm(late)


def test_every_cart_has_its_own_friction_and_ripples(bench):
    groups = {d.group for d in directions(bench, RIG)}
    for cart in ("of cart 1", "of cart 2"):
        assert {f"{what} {cart}" for what in ("friction", "viscous friction", "wander")} <= groups
        assert {f"{what} {cart}, {band}" for what in ("rough track", "hills") for band in WAVES_MM} <= groups
    assert "start deflection" in groups


def test_the_track_of_an_axis_that_turns_repeats_with_every_turn():
    units = Units("rad", "N m", per_length=10.0)
    lengths = [length for band in waves(units).values() for length in band]
    # a longer wave would be a constant force to all recordings
    assert max(lengths) == pytest.approx(20.0 * np.pi)
    assert np.allclose(np.array(max(lengths)) / lengths, np.round(np.array(max(lengths)) / lengths))
    assert waves(LAB) == WAVES_MM


def test_hills_pull_at_a_cart_that_rolls_easily_too(bench):
    easily = {**RIG, "d2": 1e-3 * RIG["d1"]}
    one, two = (
        [float(np.max(np.abs(d.force(0)))) for d in directions(bench, easily) if d.group == f"hills of cart {c}, long"]
        for c in (1, 2)
    )
    assert two == pytest.approx(one, rel=0.5)


def test_the_spectrum_of_a_track_is_estimated(bench):
    found = directions(bench, RIG)
    rng, residual = np.random.default_rng(0), bench.residual(RIG)
    waves = [d for d in found if d.group == "hills of cart 1, medium"]
    for d in waves:
        for rows in bench.rows:
            residual[rows] += 3.0 * d.size * rng.standard_normal() * d.change[rows]
    scale = estimate(bench, RIG, residual, found).scale
    assert scale["hills of cart 1, medium"] > 1.5 * scale["hills of cart 1, short"]
    assert scale["hills of cart 1, medium"] > 1.5


def test_no_clock_is_off_by_more_than_its_sample(bench):
    found = directions(bench, RIG)
    (instant,) = [d for d in found if d.group == "sampling instant"]
    late = bench.residual({**RIG, "input_delay.tau": 8e-3})
    assert estimate(bench, RIG, late, found).scale["sampling instant"] <= 1.0
    assert instant.size < 0.5

"""What is taken out of a residual before it is asked what is noise."""

import numpy as np

from identification.mismatch.candidates.catalogue import catalogue
from identification.mismatch.fitting.fit import fit
from identification.mismatch.noise.estimate import estimate, first_noise, unexplained
from identification.mismatch.noise.nuisance import directions
from identification.mismatch.selection.linear import linearise
from identification.mismatch.selection.ripples import ripples
from identification.topology import TWO_CARTS
from tests.drive.drives import RIG
from tests.identification.mismatch.lab import bench_of, data_set

ECCENTRIC = {"encoder_eccentricity.a_sin": 0.5, "encoder_eccentricity.P": 15.0}


def around(bench, ids):
    """All candidates with these names around the base model's optimum."""
    some = [c for c in catalogue(TWO_CARTS, {}, None) if c.name[0] in ids]
    noise = first_noise(bench, RIG)
    return linearise(bench, noise, fit(bench, noise, RIG, TWO_CARTS.free), some, ())


def left_by(linear):
    return unexplained(linear.noise, linear.model.residual, linear.common)


def test_a_ripple_with_a_phase_of_its_own_in_every_run_is_no_noise():
    with bench_of(data_set(ECCENTRIC)) as bench:
        linear = around(bench, {"encoder_eccentricity"})
        left = left_by(linear)
        waves = ripples(linear, left)
        assert {d.group for d in waves} == {"encoder_eccentricity@encoder_2"}
        found = directions(bench, RIG)
        alone, beside = (estimate(bench, RIG, left, (*found, *more)).scale for more in ((), waves))
    assert beside["encoder_eccentricity@encoder_2"] > 0.3
    # what a wavy reading shows, forces along the track would have to make
    track = [g for g in alone if g.endswith("of cart 2, short")]
    assert track
    assert sum(beside[g] ** 2 for g in track) < 0.5 * sum(alone[g] ** 2 for g in track)


def test_where_there_is_no_ripple_none_is_taken_for_one():
    with bench_of(data_set()) as bench:
        linear = around(bench, {"encoder_eccentricity", "cogging", "position_friction"})
        assert ripples(linear, left_by(linear)) == []


def test_what_all_recordings_share_is_no_noise():
    """A constant force that every recording has is not put down to slow forces, which would hide it."""
    with bench_of(data_set({"input_offset.u0": 0.1})) as bench:
        linear = around(bench, {"input_offset"})
        base, found = linear.model, directions(bench, linear.model.values)
        alone, beside = (
            estimate(bench, base.values, base.residual, found, common=common).forces for common in (None, linear.common)
        )
    assert beside.slow[0] * np.sqrt(beside.time_s) < 0.5 * alone.slow[0] * np.sqrt(alone.time_s)


def test_what_predicts_other_experiments_is_taken_out():
    with bench_of(data_set({"input_offset.u0": 0.1})) as bench:
        linear = around(bench, {"input_offset"})
        left, noise = left_by(linear), linear.noise
        before, after = (float(np.sum(noise.white(x) ** 2)) for x in (linear.model.residual, left))
    assert after < 0.8 * before

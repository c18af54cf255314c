"""Ripples and oscillations with a phase of their own in every recording are found; a ground spring is no ripple."""

import numpy as np
import pytest

from identification.mismatch.candidates.catalogue import Candidate, catalogue, further
from identification.mismatch.candidates.narrow_band import lines
from identification.mismatch.candidates.phases import phases
from identification.mismatch.fitting.fit import fit
from identification.mismatch.noise.estimate import estimate
from identification.mismatch.selection.evaluate import evaluate
from identification.mismatch.selection.linear import linearise
from identification.topology import TWO_CARTS
from tests.drive.drives import RIG
from tests.identification.mismatch.lab import bench_of, data_set

RIPPLE = Candidate("cogging", "drivetrain", (("cogging.a_sin", 0.05),), (("cogging.P", 12.0),))


def test_details_of_a_law_are_fitted_only_once_the_effect_leads():
    """They are in no grid and no candidate by themselves, and every candidate of their effect has them for later."""
    found = [
        c
        for c in catalogue(TWO_CARTS, {}, 3.0)
        if c.id in {"coil_bind", "coupling_backlash", "gain_drift", "saturation"}
    ]
    assert {k for c in found for k, _ in c.finer} == {
        "coil_bind.n", "coupling_backlash.loss", "gain_drift.s", "saturation.softness",
    }  # fmt: skip
    assert all(c.finer and not {k for k, _ in c.finer} & set(c.keys) for c in found)
    assert not any(c.finer for c in catalogue(TWO_CARTS, {}, 3.0) if c.id == "hardening_spring")


def _table(runs):
    with bench_of(runs) as bench:
        base = bench.residual(RIG)
        noise = estimate(bench, RIG, base, ())
        model = fit(bench, noise, RIG, ("m1", "b1", "d1", "k", "m2", "b2", "d2"))
        linear = linearise(bench, noise, model, [RIPPLE], [])
        return evaluate(linear, linear.residual[:, None])


def test_cogging_is_found_with_its_period_wherever_recordings_begin():
    """To first order: a ripple that moves the carts off their track is for the fits."""
    rng = np.random.default_rng(0)
    runs = []
    for i in range(6):
        turn = rng.uniform(0.0, 2.0 * np.pi)
        effect = {"cogging.a_sin": 0.06 * np.cos(turn), "cogging.a_cos": 0.06 * np.sin(turn), "cogging.P": 11.0}
        runs.append(data_set(effect, force=0.02)[i])
    table = _table(runs)
    best = table.best["cogging", "drivetrain"]
    assert table.total["cogging", "drivetrain"][0] > 100.0
    assert _table(data_set(force=0.05)).total["cogging", "drivetrain"][0] < 30.0
    assert best.candidate.period == pytest.approx(11.0, rel=0.1)
    assert np.sqrt(2.0 * best.variance) == pytest.approx(0.06, rel=0.5)


def test_an_oscillation_that_no_command_makes_is_found_at_its_frequency():
    with bench_of(data_set()) as bench:
        rng = np.random.default_rng(0)
        rest = rng.normal(size=(len(bench.valid), 1))
        for p in bench.pieces:
            if p.cart == 0:
                t = 0.005 * np.arange(p.rows.stop - p.rows.start)
                rest[p.rows, 0] += 0.8 * np.sin(2.0 * np.pi * 7.3 * t + rng.uniform(0.0, 6.0))
        first, second = lines(bench, rest)
    assert first[0].frequency == pytest.approx(7.3, abs=0.3)
    assert first[1].sum() > 50.0
    assert second[1].sum() < 10.0


def test_ripples_have_periods_within_the_way_travelled():
    with bench_of(data_set()[:1]) as bench:
        way = max(float(np.ptp(x)) for x in bench.runs[0].track)
        assert all(p.period <= 1.05 * way for p, _ in phases(bench, RIG))


def test_ripples_are_as_long_as_the_longest_way():
    """Fast sines hardly move a cart; the slow ones tell of the track."""
    kinds = (*(("sine", 2.5, f) for f in (8.0, 10.0, 12.0, 16.0)), ("sine", 2.5, 0.8))
    with bench_of(data_set(kinds=kinds)) as bench:
        way = max(float(np.ptp(run.track[0])) for run in bench.runs)
        longest = max(p.period for p, _ in phases(bench, RIG) if p.name == ("cogging", "drivetrain"))
        assert longest > 0.8 * way


def test_a_filter_is_a_candidate_where_nothing_tells_how_velocities_were_made():
    assert not [c for c in catalogue(TWO_CARTS) if c.id == "velocity_processing"]
    found = [c for c in catalogue(TWO_CARTS, filtered=True) if c.id == "velocity_processing"]
    assert {c.where for c in found} == {"encoder_1", "encoder_2"}
    # it is absent at infinity, and acts in no proportion to its cut-off
    assert not any(c.proportional for c in found)
    known = ("velocity_processing.encoder_2.cutoff",)
    assert {c.where for c in catalogue(TWO_CARTS, known, filtered=True) if c.id == "velocity_processing"} == {
        "encoder_1"
    }


def test_of_what_has_a_name_only_other_sizes_of_a_plain_law_are_asked():
    found = catalogue(TWO_CARTS, {}, None)
    spring = next(c for c in found if [k for k, _ in c.sizes] == ["ground_spring.kg"])
    asked = {k for c in found if c.name == spring.name and further(c, spring) for k in c.keys}
    assert asked == {"ground_spring.kg3", "ground_spring.kg_2"}
    # a wave has a period, which one of another period would have to share
    for wave in (c for c in found if c.shapes):
        assert not any(further(c, wave) for c in found if c.name == wave.name)
    # of what has no size in the simulation, a ripple with a phase of its own in every run, no more is asked
    assert not further(spring, object())
    assert further(spring, None)

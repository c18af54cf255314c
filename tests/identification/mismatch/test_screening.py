"""Screening puts a planted effect first, and chance is as likely as it says."""

import numpy as np
import pytest

from identification.mismatch.candidates import Candidate, catalogue
from identification.mismatch.chance import chance, null_residuals
from identification.mismatch.crew import Crew
from identification.mismatch.rounds import best_of_each, directions, screened_in
from identification.mismatch.screening import Screened
from identification.mismatch.settle import settle
from identification.topology import TWO_CARTS
from tests.drive.drives import RIG
from tests.identification.mismatch.lab import SHORT, short_day, workbench

SOME = {
    "stribeck",
    "quadratic_drag",
    "hardening_spring",
    "dead_zone",
    "coulomb_asymmetry",
    "encoder_scale",
    "presliding",
}


def judged(recordings, pool):
    bench = workbench(recordings, pool)
    model = settle(bench, RIG, TWO_CARTS.free)
    candidates = [c for c in catalogue() if c.id in SOME]
    columns = directions(bench, candidates, model.values, bench.residual(model.values))
    return bench, model, {view: screened_in(bench, view, model, candidates, columns) for view in bench.views}


@pytest.mark.parametrize(
    ("name", "effect"),
    [
        (("dead_zone", "actuator"), {"dead_zone.uz": 0.2}),
        (("hardening_spring", "spring"), {"hardening_spring.k3": 3e-4}),
        (("stribeck", "cart_1"), {"stribeck.cart_1.extra": 0.15, "stribeck.cart_1.vs": 40.0}),
    ],
)
def test_a_planted_effect_comes_first(name, effect):
    with Crew(2) as pool:
        *_, views = judged(short_day(effect), pool)
    assert best_of_each(views["comparable"])[0].candidate.name == name
    # of plain residuals it explains most
    assert max(s.gain for s in views["weighted"] if s.candidate.name == name) > 0.5


def test_null_draws_are_calibrated():
    """The probability of draws that are themselves null is uniform: their mean is a half."""
    with Crew(2) as pool:
        bench, model, views = judged(short_day(kinds=SHORT[1:4]), pool)
        reference, others = (
            chance(bench, views, null_residuals(bench, model.values, np.random.default_rng(seed), draws), model)
            for seed, draws in ((1, 60), (2, 30))
        )
    found = []
    for gains in others.gains:
        best = max(reference.names, key=lambda n: max(reference.surprise(n, gains[reference.names.index(n)])))
        found.append(reference.probability(best, gains[reference.names.index(best)]))
    # the mean of 30 uniform numbers has a standard deviation of 0.053
    assert np.mean(found) == pytest.approx(0.5, abs=0.16)
    assert min(found) >= 1 / 61


def test_what_repeats_along_the_track_has_one_amplitude():
    """A wave whose amplitude is the same in every run explains what runs with amplitudes of their own do not."""
    with Crew(2) as pool:
        bench, *_ = judged(short_day(kinds=SHORT[1:4]), pool)
        rows = [bench.rows.of(r) for r in range(len(bench.runs))]
        waves = np.zeros((len(bench.weights), 2))
        for i in rows:
            n = i.stop - i.start
            waves[i] = np.column_stack([np.sin(np.arange(n)), np.cos(np.arange(n))])
        found = Screened(Candidate("cogging", "drivetrain", (), ()), 0.0, (), 0.0, waves[:, :0], waves)
        turns = [(0.3, 1.0), (2.0, 1.0), (4.0, 1.0)]
        same = np.concatenate([waves[i] @ [np.cos(a), np.sin(a)] for i, (a, _) in zip(rows, turns, strict=True)])
        once = np.concatenate([waves[i] @ [1.0 if r == 0 else 0.0, 0.0] for r, i in enumerate(rows)])
        assert found.explains(bench, same) == pytest.approx(np.sum(same**2), rel=0.01)
        assert found.explains(bench, once) < 0.5 * np.sum(once**2)


def test_a_force_that_all_runs_share_is_seen_better_as_weighted():
    """Any single run might have had it by itself, so comparable residuals hardly show it."""
    with Crew(2) as pool:
        bench, model, views = judged(short_day({"coulomb_asymmetry.cart_1.a": 0.02}), pool)
        luck = chance(bench, views, null_residuals(bench, model.values, np.random.default_rng(1), 40), model)
    name = ("coulomb_asymmetry", "cart_1")
    gains = [max(s.gain for s in views[view] if s.candidate.name == name) for view in ("comparable", "weighted")]
    comparable, weighted = luck.surprise(name, gains)
    assert weighted > comparable

"""Screening puts a planted effect first, and chance is as likely as it says."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from identification.mismatch.candidates import catalogue
from identification.mismatch.chance import chance, null_residuals
from identification.mismatch.screening import orthonormal, screen
from identification.mismatch.search import baseline, best_of_each, directions
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
    model = baseline(bench, RIG, TWO_CARTS.free)
    present = orthonormal(model.jacobian)
    residual = model.residual - present @ (present.T @ model.residual)
    candidates = [c for c in catalogue() if c.id in SOME]
    columns = directions(bench, candidates, model.values, bench.residual(model.values))
    screened = [screen(bench, c, s, residual, present) for c, s in zip(candidates, columns, strict=True)]
    return bench, model, present, screened


@pytest.mark.parametrize(
    ("name", "effect"),
    [
        (("dead_zone", "actuator"), {"dead_zone.uz": 0.2}),
        (("hardening_spring", "spring"), {"hardening_spring.k3": 3e-4}),
        (("stribeck", "cart_1"), {"stribeck.cart_1.extra": 0.15, "stribeck.cart_1.vs": 40.0}),
    ],
)
def test_a_planted_effect_comes_first(name, effect):
    with ThreadPoolExecutor(2) as pool:
        *_, screened = judged(short_day(effect), pool)
    first = best_of_each(screened)[0]
    assert first.candidate.name == name
    assert first.gain > 0.3


def test_null_draws_are_calibrated():
    """The probability of draws that are themselves null is uniform: their mean is a half."""
    with ThreadPoolExecutor(2) as pool:
        bench, model, present, screened = judged(short_day(kinds=SHORT[1:4]), pool)
        reference = chance(bench, screened, null_residuals(bench, model.values, np.random.default_rng(1), 60), present)
        others = chance(bench, screened, null_residuals(bench, model.values, np.random.default_rng(2), 30), present)
    found = []
    for gains in others.gains:
        best = int(np.argmax(gains / reference.usual))
        found.append(reference.probability(reference.names[best], float(gains[best])))
    # the mean of 30 uniform numbers has a standard deviation of 0.053
    assert np.mean(found) == pytest.approx(0.5, abs=0.16)
    assert min(found) >= 1 / 61

"""Where fits of candidates begin."""

from dataclasses import replace

import numpy as np
import pytest

from identification.mismatch.candidates.catalogue import catalogue
from identification.mismatch.fitting.fit import fit
from identification.mismatch.noise.estimate import first_noise
from identification.mismatch.selection.evaluate import evaluate
from identification.mismatch.selection.linear import linearise
from identification.mismatch.selection.optima import fit_candidates, refined
from identification.mismatch.selection.start import candidate_starts, misread_starts
from identification.topology import TWO_CARTS
from tests.drive.drives import RIG
from tests.identification.mismatch.lab import KINDS, bench_of, data_set


@pytest.mark.parametrize("softness", [0.0, 0.15])
def test_a_limit_begins_where_it_cuts_and_not_at_a_share_of_it(softness):
    """Half of what a limit of 2.1 V does is no limit of 1 V: a fit from there sees another drive. It may be hard or round."""
    name = "saturation", "actuator"
    limits = [c for c in catalogue(TWO_CARTS, {}, 2.5) if c.name == name]
    with bench_of(data_set({"saturation.limit": 2.3, "saturation.softness": softness}, kinds=KINDS[2:6])) as bench:
        noise = first_noise(bench, RIG)
        base = fit(bench, noise, RIG, TWO_CARTS.free)
        linear = linearise(bench, noise, base, limits, ())
        table = evaluate(linear, linear.residual[:, None])
        starts = candidate_starts(base, linear, table, limits, [name], 1)
        assert {v["saturation.limit"] for _, v in starts} <= {c.sizes[0][1] for c in limits}
        _, found = refined(base, noise, fit_candidates(base, noise, starts))[name]
    assert abs(found.values["saturation.limit"] / 2.3 - 1.0) < 0.01
    assert found.values.get("saturation.softness", 0.0) == pytest.approx(softness, abs=0.02)


def test_static_friction_is_found_where_the_base_model_took_it_for_dry_friction():
    """Held as before, a cart shows nothing of what holds it: to first order around that drive there is no static friction."""
    key, name = "breakaway.cart_2.extra", ("breakaway", "cart_2")
    candidates = [c for c in catalogue(TWO_CARTS, {}, None) if c.name == name]
    kinds = (("square", 1.5, 0.8), ("square", 0.8, 0.8), ("sine", 0.8, 0.8), ("sine", 0.8, 1.5))
    truth = 3.0 * RIG["d2"]
    with bench_of(data_set({key: truth}, kinds=kinds)) as bench:
        noise = first_noise(bench, RIG)
        base = fit(bench, noise, {**RIG, "d2": 4.0 * RIG["d2"]}, TWO_CARTS.free)
        linear = linearise(bench, noise, base, candidates, ())
        table = evaluate(linear, linear.residual[:, None])
        starts = candidate_starts(base, linear, table, candidates, [], 0)
        _, found = fit_candidates(base, noise, starts)[name]
    assert abs(found.values[key] / truth - 1.0) < 0.1
    assert found.cost < 0.8 * base.cost


def test_a_reading_without_sign_is_found_from_a_drive_as_usual():
    """The handout's model fitted to such readings has no spring to speak of: its second cart is no start."""
    rectified = [replace(r, x1=None, x2=None, v2=np.abs(r.v2)) for r in data_set(kinds=KINDS[2:6])]
    candidates = [c for c in catalogue(TWO_CARTS, {}, None) if c.name == ("rectified_sensor", "encoder_2")]
    with bench_of(rectified) as bench:
        noise = first_noise(bench, RIG)
        base = fit(bench, noise, {**RIG, "k": 1e-3 * RIG["k"], "m2": 10.0 * RIG["m2"]}, TWO_CARTS.free, iterations=0)
        starts = [(c, {**base.values, **own}) for c, own in misread_starts(base.values, candidates, TWO_CARTS)]
        assert all(v["k"] > 100.0 * base.values["k"] for _, v in starts)
        _, found = fit_candidates(base, noise, starts)["rectified_sensor", "encoder_2"]
    assert found.values["rectified_sensor.encoder_2.share"] > 0.99
    assert abs(found.values["k"] / RIG["k"] - 1.0) < 0.05

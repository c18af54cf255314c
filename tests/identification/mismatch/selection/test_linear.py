"""Sensitivities to all candidates, whitened."""

from dataclasses import replace

import pytest

from identification.mismatch.candidates.catalogue import catalogue
from identification.mismatch.fitting.fit import fit
from identification.mismatch.noise.estimate import first_noise
from identification.mismatch.selection.linear import Linear, linearise
from identification.topology import TWO_CARTS
from tests.drive.drives import RIG
from tests.identification.mismatch.lab import KINDS, bench_of, data_set


def test_another_base_model_leaves_the_candidates_columns_as_they_are():
    some = [c for c in catalogue(TWO_CARTS, {}, None) if c.name[0] in {"quadratic_drag", "ground_spring"}]
    with bench_of(data_set(kinds=KINDS[2:4])) as bench:
        noise = first_noise(bench, RIG)
        base = fit(bench, noise, RIG, TWO_CARTS.free, iterations=2)
        linear = linearise(bench, noise, base, some, ())
        # a parameter at its bound has no column
        other = fit(bench, noise, {**base.values, "d2": 0.0}, TWO_CARTS.free, iterations=0)
        around = linear.around(other, noise)
        anew = Linear.of(other, noise, linear.changes, around.entries)
        assert len(around.base) < len(linear.base)
        assert around.white == pytest.approx(anew.white, rel=1e-4, abs=1e-4)
        assert around.products == pytest.approx(anew.products, rel=1e-4, abs=1e-4 * float(abs(anew.products).max()))
        # and equal noise whitens them as this one does
        assert linear.around(base, replace(noise)).white == pytest.approx(linear.white, rel=1e-9, abs=1e-12)

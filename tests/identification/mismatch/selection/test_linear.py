"""Sensitivities to all candidates, whitened."""

from dataclasses import replace

import numpy as np
import pytest

from identification.mismatch.candidates.catalogue import catalogue
from identification.mismatch.fitting.fit import fit
from identification.mismatch.fitting.levels import Levels
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


def test_a_change_that_parts_from_the_motion_is_taken_at_a_lesser_size_too():
    """A spring that is plainly harder has another resonance; the motion of one that is a little harder is not a tenth of that."""
    light = {"m1": 0.0012, "m2": 0.00063, "b1": 0.0086, "b2": 0.0009, "d1": 0.22, "d2": 0.022, "k": 0.088}
    little = {"hardening_spring.k3": 2e-6}
    some = [c for c in catalogue(TWO_CARTS, {}, None) if c.name[0] in {"hardening_spring", "input_offset"}]
    runs = data_set(little, kinds=(("sine", 2.5, 2.2), ("sine", 2.5, 2.4)), t=np.arange(8001) * 1e-3, rig=light)
    with bench_of(runs) as bench:
        base = fit(bench, Levels.of(bench, bench.residual(light)), light, TWO_CARTS.free)
        linear = linearise(bench, first_noise(bench, light), base, some, ())
        change = bench.residual({**base.values, **little}) - base.residual
        along: dict[str, list[float]] = {}
        for entry in linear.entries:
            column = linear.changes[:, entry.columns[0] - len(linear.base)]
            cosine = float(column @ change) / float(np.linalg.norm(column) * np.linalg.norm(change))
            along.setdefault(entry.candidate.name[0], []).append(cosine)
        # at the usual sizes, ten and twenty times as hard, and at one that could be there
        assert min(along["hardening_spring"]) < 0.9
        assert max(along["hardening_spring"]) > 0.99
        # what is in proportion to its size has one column
        assert len(along["input_offset"]) == 1

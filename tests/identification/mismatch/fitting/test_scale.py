"""What is usual on a rig goes with its commands and its motion."""

from dataclasses import replace

import numpy as np
import pytest

from identification.mismatch.candidates.catalogue import catalogue
from identification.mismatch.fitting.scale import HANDOUT, Scale
from identification.topology import TWO_CARTS, Topology
from tests.drive.drives import RIG
from tests.identification.mismatch.lab import KINDS, T, bench_of, data_set

TENTH = Scale(command=0.1)


def test_the_handouts_experiments_have_the_scale_of_the_handout():
    with bench_of(data_set()) as bench:
        assert bench.scale == HANDOUT


def test_a_faulty_encoder_says_nothing_of_the_speed():
    with bench_of(data_set(kinds=KINDS[:2])) as bench:
        odd = np.arange(len(T)) % 2 == 1
        runs = [replace(r, measured=[np.where(odd, 1e6, v) for v in r.measured], keep=[~odd] * 2) for r in bench.runs]
    assert Scale.of(runs) == HANDOUT


def test_where_nothing_moves_the_scale_is_that_of_the_handout():
    with bench_of(data_set(kinds=KINDS[:1])) as bench:
        still = [
            replace(r, u=0.0 * r.u, measured=[0.0 * v for v in r.measured], track=0.0 * r.track) for r in bench.runs
        ]
    assert Scale.of(still) == HANDOUT


def test_a_rig_that_takes_a_tenth_of_the_force_has_effects_of_a_tenth():
    """The equations are free of scale: with all forces a tenth as large every effect of usual size does the same."""
    light, runs = {name: 0.1 * value for name, value in RIG.items()}, data_set(kinds=KINDS[:2])
    with bench_of(runs) as bench, bench_of([replace(r, u=0.1 * r.u) for r in runs]) as other:
        assert other.scale == TENTH
        usual, smaller = catalogue(TWO_CARTS, reach=2.2), catalogue(TWO_CARTS, reach=0.22, scale=TENTH)
        for own, less in zip(usual, smaller, strict=True):
            rows, same = bench.residual({**RIG, **own.start}), other.residual({**light, **less.start})
            np.testing.assert_allclose(same, rows, atol=0.02, err_msg=f"{own.name} {own.start} {less.start}")


def test_dry_friction_begins_at_a_share_of_the_command():
    bodies = Topology("without dry friction", 2, ("m1", "m2", "b1", "b2", "k"))
    sizes = [c.start["d1"] for c in catalogue(bodies, scale=TENTH) if c.name == ("coulomb_friction", "cart_1")]
    assert sizes == pytest.approx([0.01, 0.03, 0.1])


def test_times_are_those_of_electronics_and_lengths_those_of_the_way():
    scale = Scale(command=10.0, velocity=0.1, way=0.01)
    assert [scale.of_unit(unit) for unit in ("s", "Hz", "1/s", "1")] == [1.0] * 4
    assert scale.of_unit("mm") == pytest.approx(0.01)
    assert scale.of_unit("mm/s") == pytest.approx(0.1)
    assert scale.of_unit("V s/mm") == pytest.approx(100.0)

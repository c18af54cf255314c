"""Blocks left out, and the average that predicts them best."""

import numpy as np
import pytest

from baselines.public_data import BENCHMARKS
from baselines.public_data.blocks import averaged, weights
from baselines.public_data.fitting import fit, piece_of, simulated, started
from tests.baselines.public_data.stand_ins import CARRIAGE, write_carriage

RNG = np.random.default_rng(0)
NOISE = [RNG.standard_normal(400) for _ in range(4)]


def test_errors_of_opposite_sign_are_averaged_away():
    errors = [[[e] for e in NOISE], [[-e] for e in NOISE]]
    assert weights(errors) == pytest.approx([0.5, 0.5], abs=1e-3)
    assert max(np.abs(e).max() for block in averaged(errors) for e in block) < 1e-2


def test_a_structure_that_has_run_away_gets_no_weight():
    errors = [[[e] for e in NOISE], [[1.01 * e] for e in NOISE], [[100.0 * e + 50.0] for e in NOISE]]
    w = weights(errors)
    assert w.sum() == pytest.approx(1.0)
    assert w[2] < 1e-3


def test_a_block_does_not_see_its_own_weights():
    good, bad = [[e] for e in NOISE], [[3.0 * e] for e in NOISE]
    # in block 0 alone the other structure is perfect
    bad[0] = [np.zeros(400)]
    assert weights([good, bad], leave_out=0)[0] > 0.9
    assert np.std(averaged([good, bad])[0][0]) > 0.8 * np.std(NOISE[0])


def test_a_fit_finds_the_carriage_that_made_the_record(tmp_path):
    write_carriage(tmp_path / "train.csv", 8.0, seed=1)
    benchmark = BENCHMARKS["emps"]
    piece = piece_of(benchmark.read(tmp_path / "train.csv"))
    start = {"m1": 2e-3, "b1": 7e-3, "d1": 0.5, "input_offset.u0": 0.05}
    values, _cost = fit(start, tuple(start), [piece], benchmark)
    assert values == pytest.approx(CARRIAGE, rel=0.02)
    error = piece.measured - simulated(values, started(values, piece, benchmark))
    assert benchmark.score(error) < 0.1

"""The workbench's algebra equals the dense formulas."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from identification.mismatch.workbench import FRICTION, OFFSET
from identification.output_error import simulate_run
from tests.drive.drives import RIG
from tests.identification.mismatch.lab import short_day, workbench


@pytest.fixture(scope="module")
def bench():
    with ThreadPoolExecutor(2) as pool:
        yield workbench(short_day()[:2], pool)


def test_blocks_are_means_of_the_residual(bench):
    run = bench.runs[1]
    error = run.measured[0] - simulate_run(RIG, run)[0]
    found = bench.residual(RIG)[bench.piece(1, 0)]
    assert found[7] == pytest.approx(error[7 * run.block : 8 * run.block].mean())


def test_random_effects_equal_the_dense_formula(bench):
    rng = np.random.default_rng(2)
    N = len(bench.weights)
    bench.forget_random_effects()
    bench.weigh(bench.residual(RIG))
    D = bench.weighted(5.0 * rng.normal(size=(N, 3)))
    e = rng.normal(size=N)
    bench.set_random_effects(D, bench.weighted(e), [FRICTION, FRICTION, OFFSET])
    S = np.diag([bench.spread[p.group] ** 2 for p in (FRICTION, FRICTION, OFFSET)])
    w = bench.weighted(e)
    expected = 0.0
    for r in range(2):
        rows = bench.rows.of(r)
        V = np.eye(len(w[rows])) + D[rows] @ S @ D[rows].T
        expected += float(w[rows] @ np.linalg.solve(V, w[rows]))
    assert np.sum(bench.comparable(e) ** 2) == pytest.approx(expected, rel=1e-10)


def test_a_push_moves_the_residual_as_the_simulation_says(bench):
    force = [np.vstack([np.ones(len(run.u)), np.zeros(len(run.u))]) for run in bench.runs]
    column = bench.pushed(RIG, [lambda: force], 0.02)[:, 0]
    pushed = bench.blocks(RIG, 0, 0.02 * force[0])
    plain = bench.blocks(RIG, 0, 0.0 * force[0])
    assert column[bench.rows.of(0)] == pytest.approx((pushed - plain) / 0.02)

"""The workbench's algebra equals the dense formulas."""

import numpy as np
import pytest

from identification.mismatch.crew import Crew
from identification.mismatch.settle import absorb
from identification.mismatch.workbench import FRICTION, OFFSET, Disturbance
from identification.replay.output_error import simulate_run
from tests.drive.drives import RIG
from tests.identification.mismatch.lab import short_day, workbench


@pytest.fixture(scope="module")
def bench():
    with Crew(2) as pool:
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


def test_surroundings_take_out_a_rough_track_and_leave_a_delay(bench):
    """The forces of a rough track hardly count among comparable residuals; those of a late command do."""
    absorb(bench, RIG)
    track = [np.vstack([0.1 * np.sin(2.0 * np.pi * run.track[0] / 25.0), np.zeros(len(run.u))]) for run in bench.runs]
    rough = bench.pushed(RIG, [lambda: track], 0.02)[:, 0]
    late = bench.residual({**RIG, "input_delay.tau": 0.002}) - bench.residual(RIG)
    left = [np.sum(bench.comparable(e) ** 2) / np.sum(bench.weighted(e) ** 2) for e in (rough, late)]
    assert left[0] < 0.1
    assert left[1] > 5.0 * left[0]


def test_sharpening_damps_what_disturbances_do_to_the_level_of_the_rest(bench):
    """In every recording the first principal directions end with the variance that the others have on average."""
    rng = np.random.default_rng(3)
    N, modes = len(bench.weights), 2
    bench.forget_random_effects()
    bench.weigh(bench.residual(RIG))
    shapes = rng.normal(size=(N, modes))
    draws = 20.0 * shapes @ rng.normal(size=(modes, 60)) + rng.normal(size=(N, 60))
    bench.sharpen(draws, np.zeros((N, 0)), modes)
    unit = draws / np.sqrt(np.mean(bench.weighted(draws) ** 2, axis=0))
    for r in range(len(bench.runs)):
        rows = bench.rows.of(r)
        U, sigma, _ = np.linalg.svd(bench.weighted(unit)[rows], full_matrices=False)
        rest = np.sum(sigma[modes:] ** 2) / (len(U) - modes)
        left = np.sum((U[:, :modes].T @ bench.comparable(unit)[rows]) ** 2, axis=1)
        assert left == pytest.approx(rest, rel=1e-6)
        others = np.sum((U[:, modes:].T @ bench.comparable(unit)[rows]) ** 2, axis=1)
        assert others == pytest.approx(sigma[modes:] ** 2)
    bench.forget_random_effects()


def test_a_draw_of_nuisance_holds_resting_carts_too(bench):
    """Friction that differs from run to run is a change of the law itself: where only it is drawn, a cart at rest stays so."""
    quiet = [Disturbance(np.zeros((2, len(run.u))), {"d1": 1.2 * RIG["d1"]}) for run in bench.runs]
    found = bench.disturbed(RIG, [lambda: quiet])[:, 0]
    expected = bench.residual({**RIG, "d1": 1.2 * RIG["d1"]}) - bench.residual(RIG)
    assert found == pytest.approx(expected, abs=0.2)


def test_a_bench_alone_finds_the_same_and_keeps_its_settings_to_itself(bench):
    other, before = bench.alone(), bench.weights.copy()
    assert np.array_equal(other.residual(RIG), bench.residual(RIG))
    other.weigh(2.0 * other.residual(RIG))
    other.offsets[:] = 3.0
    assert np.array_equal(bench.weights, before)
    assert not np.array_equal(other.weights, before)
    assert not bench.offsets.any()


def test_what_was_found_lately_belongs_to_where_runs_began(bench):
    """A wave along the track meets every run elsewhere once that is known."""
    wave = {**RIG, "cogging.a_sin": 0.1, "cogging.P": 20.0}
    other, before = bench.alone(), bench.residual(wave)
    other.offsets[:] = 3.0
    assert not np.array_equal(other.residual(wave), before)
    assert np.array_equal(bench.residual(wave), bench.together.residual(wave, bench.offsets))


def test_taking_out_directions_equals_the_formula_and_tells_what_is_left(bench):
    rng = np.random.default_rng(4)
    N = len(bench.weights)
    hidden, X = np.linalg.qr(rng.normal(size=(N, 5)))[0], rng.normal(size=(N, 70))
    expected = X - hidden @ (hidden.T @ X)
    square = bench.without(X, hidden)
    assert np.allclose(X, expected, rtol=0.0, atol=1e-12)
    assert square == pytest.approx(np.sum(expected**2, axis=0))

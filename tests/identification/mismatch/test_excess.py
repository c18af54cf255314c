"""An error that no restless rig has is told from one that it may have."""

from dataclasses import replace

import numpy as np
import pytest

from identification.mismatch.chance import null_residuals
from identification.mismatch.crew import Crew
from identification.mismatch.excess import excess
from identification.mismatch.settle import settle
from identification.topology import TWO_CARTS
from tests.drive.drives import RIG
from tests.identification.mismatch.lab import SHORT, T, pushed_run, short_day, workbench

DRAWS = 60


def excess_of(recordings):
    with Crew(2) as pool:
        bench = workbench(recordings, pool)
        model = settle(bench, RIG, TWO_CARTS.free)
        null = null_residuals(bench, model.values, np.random.default_rng(1), DRAWS)
        # alone, it outlives the pool
        return bench.alone(), model, null, excess(bench, null, model)


def struck(run, seed):
    """The same run with blows on cart 2, about two a second."""
    rng, push = np.random.default_rng(seed), np.zeros((2, len(T)))
    for at in rng.uniform(0.0, T[-1], 5):
        push[1] += rng.choice([-1.0, 1.0]) * 2.0 * np.exp(-(((T - at) / 0.01) ** 2))
    hit = pushed_run(RIG, run.u, push, excitation=run.excitation)
    rest = pushed_run(RIG, run.u, np.zeros_like(push))
    return replace(run, v1=run.v1 + hit.v1 - rest.v1, v2=run.v2 + hit.v2 - rest.v2)


def test_blows_are_more_than_a_restless_rig_has():
    day = [struck(run, seed) for seed, run in enumerate(short_day(kinds=SHORT[1:4]))]
    *_, found = excess_of(day)
    assert found.probability == pytest.approx(1 / (1 + DRAWS))
    assert found.where == "cart_2"
    assert found.share > 0.5
    assert sum(share for _, share in found.runs) <= 1.0


def test_a_quiet_rig_has_no_excess_and_draws_have_it_as_often_as_they_say():
    bench, model, null, found = excess_of(short_day(kinds=SHORT[1:4]))
    assert found.probability > 0.1
    # every draw in turn as if it were the recordings
    judged = [
        excess(
            bench,
            np.delete(null, i, axis=1),
            replace(model, residual=bench.comparable(null[:, i]), minimised=bench.weighted(null[:, i])),
        ).probability
        for i in range(0, DRAWS, 3)
    ]
    # the mean of 20 numbers that are uniform, or a little less where a draw has two views to be large in
    assert np.mean(judged) == pytest.approx(0.5, abs=0.2)
    assert min(judged) >= 1 / DRAWS

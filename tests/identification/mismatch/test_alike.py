"""Recordings agree about the size of what is there, and disagree about that of what only resembles it."""

from dataclasses import replace

import numpy as np
import pytest

from identification.mismatch.alike import disagreement
from identification.mismatch.chance import null_residuals
from identification.mismatch.crew import Crew
from identification.mismatch.settle import settle
from identification.topology import TWO_CARTS
from tests.drive.drives import RIG
from tests.identification.mismatch.lab import SHORT, pushed_run, short_day, workbench

DRAWS = 59
SIZE = "saturation.limit"


def clipped(run, limit):
    """The same run of a rig whose command is cut off at a limit."""
    push = np.zeros((2, len(run.u)))
    push[0] = np.clip(run.u, -limit, limit) - run.u
    cut = pushed_run(RIG, run.u, push, excitation=run.excitation)
    whole = pushed_run(RIG, run.u, np.zeros_like(push))
    return replace(run, v1=run.v1 + cut.v1 - whole.v1, v2=run.v2 + cut.v2 - whole.v2)


def disagreed(limits):
    day = [clipped(run, limit) for run, limit in zip(short_day(kinds=SHORT[1:]), limits, strict=True)]
    with Crew(2) as pool:
        bench = workbench(day, pool)
        model = settle(bench, {**RIG, SIZE: 1.8}, (*TWO_CARTS.free, SIZE))
        null = null_residuals(bench, model.values, np.random.default_rng(1), DRAWS)
        return disagreement(bench, model, null, [SIZE], "comparable")


def test_one_limit_of_the_command_suits_all_recordings():
    found = disagreed([1.8] * 4)
    assert found.probability > 0.05
    assert found.share < 0.1


def test_limits_that_differ_between_recordings_are_none_of_the_command():
    found = disagreed([1.4, 1.6, 1.8, 2.2])
    assert found.probability == pytest.approx(1 / (1 + DRAWS))
    assert found.share > 0.3
    assert found.where in {"cart_1", "cart_2"}

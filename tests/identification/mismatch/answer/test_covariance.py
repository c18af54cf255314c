"""Intervals of parameters: as many standard errors as simulated data sets need."""

import numpy as np
import pytest

from identification.mismatch.answer.covariance import uncertainty
from identification.mismatch.fitting.fit import fit
from identification.mismatch.fitting.levels import Levels
from identification.topology import TWO_CARTS
from tests.drive.drives import RIG
from tests.identification.mismatch.lab import bench_of, data_set


@pytest.fixture(scope="module")
def best():
    with bench_of(data_set()) as bench:
        levels = Levels.of(bench, bench.residual(RIG))
        yield fit(bench, levels, RIG, TWO_CARTS.free)


@pytest.fixture(scope="module")
def white(best):
    """Simulated errors that are independent, as large as those of the data."""
    size = np.where(best.metric.weights > 0.0, 1.0 / np.maximum(best.metric.weights, 1e-12), 0.0)
    return size[:, None] * np.random.default_rng(0).standard_normal((len(size), 200))


def width(limits, name):
    low, high = limits[name]
    return (high - low) / (high + low)


def test_intervals_are_those_of_the_joint_covariance(best, white):
    limits, covariance = uncertainty(best, white)
    i = covariance.names.index("m1")
    # Student's t of five degrees of freedom: six experiments
    half = 2.5706 * np.sqrt(covariance.matrix[i, i]) / best.values["m1"]
    assert width(limits, "m1") == pytest.approx(np.tanh(half), rel=1e-3)


def test_what_all_recordings_share_widens_an_interval_though_no_recording_left_out_shows_it(best, white):
    column = best.jacobian[:, best.names.index("b1")]
    common = column[:, None] * np.random.default_rng(1).standard_normal(white.shape[1])
    few, more = (width(uncertainty(best, white + a * common)[0], "b1") for a in (0.0, 0.1))
    assert more > 3.0 * few


def test_how_large_simulated_errors_are_does_not_matter(best, white):
    """Recordings tell how large errors are; simulated ones how far an estimate is off in units of what it takes for its error."""
    assert width(uncertainty(best, 0.1 * white)[0], "k") == pytest.approx(
        width(uncertainty(best, white)[0], "k"), rel=0.2
    )

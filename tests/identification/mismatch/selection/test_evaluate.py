"""Gains of changes whose information and presence in experiments are known."""

from types import SimpleNamespace

import numpy as np
import pytest

from identification.mismatch.fitting.bench import Bench
from identification.mismatch.selection import evaluate as module
from identification.mismatch.selection.evaluate import evaluate
from identification.mismatch.selection.linear import Entry, Linear
from identification.mismatch.settings import Settings

EXPERIMENTS, ROWS = 12, 200
NAME = ("change", "somewhere")


@pytest.fixture
def gain_where(monkeypatch):
    """Gain of one column that has information in some of twelve experiments and is present in some of them."""
    monkeypatch.setattr(module, "lines", lambda *_: [])

    def gain(shown, present):
        rng = np.random.default_rng(4)
        # rows of no recordings
        bench = object.__new__(Bench)
        bench.settings, bench.units = Settings(), np.arange(EXPERIMENTS)
        bench.rows = [slice(ROWS * u, ROWS * (u + 1)) for u in range(EXPERIMENTS)]
        column = rng.normal(size=(EXPERIMENTS, ROWS)) * np.isin(np.arange(EXPERIMENTS), shown)[:, None]
        residual = rng.normal(size=column.shape) + column * np.isin(np.arange(EXPERIMENTS), present)[:, None]
        products = np.sum(column**2, axis=1)[:, None, None]
        entry = Entry(SimpleNamespace(name=NAME), (0,))
        white = column.reshape(-1, 1)
        linear = Linear(SimpleNamespace(bench=bench), None, (entry,), white, white, products, residual.ravel())
        return evaluate(linear, residual.reshape(-1, 1)).best[NAME].gain

    return gain


def test_what_only_two_experiments_can_show_counts(gain_where):
    gain = gain_where([0, 7], [0, 7])
    # half of 200 rows each, give or take
    assert 150.0 < gain.sum() < 250.0
    assert np.all(np.abs(np.delete(gain, [0, 7])) < 1e-9)


def test_what_one_experiment_alone_shows_is_no_property_of_a_rig(gain_where):
    assert abs(gain_where(range(EXPERIMENTS), [0]).sum()) < 5.0


def test_one_odd_experiment_does_not_hide_what_the_others_show(gain_where):
    assert gain_where(range(EXPERIMENTS), range(1, EXPERIMENTS)).sum() > 700.0

"""A round refits what leads, and what looks like it from where the leader ended."""

from types import SimpleNamespace

import numpy as np
import pytest

from identification.mismatch import rounds
from identification.mismatch.candidates import catalogue
from identification.mismatch.crew import Crew
from identification.mismatch.settle import settle
from identification.topology import TWO_CARTS
from tests.drive.drives import RIG
from tests.identification.mismatch.lab import short_day, workbench

SOME = {"stribeck", "breakaway", "quadratic_drag", "dead_zone", "coulomb_asymmetry"}


@pytest.fixture
def few(monkeypatch):
    """A catalogue of what looks like friction at rest."""
    monkeypatch.setattr(rounds, "catalogue", lambda *a: [c for c in catalogue(*a) if c.id in SOME])


def test_a_look_alike_is_refitted_from_where_the_leader_ended(few):
    """A breakaway several times its usual size is far from any drive without one; a low-speed hump is on the way."""
    with Crew(2) as pool:
        bench = workbench(short_day({"breakaway.cart_1.extra": 1.2}), pool)
        model = settle(bench, RIG, TWO_CARTS.free)
        found = rounds.stage(bench, model, TWO_CARTS, np.random.default_rng(0), {}, {})
    rival = next(r for r in found.rivals if r.name == ("breakaway", "cart_1"))
    assert rival.fit.values["breakaway.cart_1.extra"] == pytest.approx(1.2, rel=0.15)
    assert rival.gain > 0.95 * found.rivals[0].gain


@pytest.mark.parametrize(
    ("effect", "where", "period", "repeats"),
    [
        ("cogging", "drivetrain", 30.0, True),
        ("cogging", "drivetrain", 90.0, False),
        ("position_friction", "cart_2", 90.0, True),
        ("stribeck", "cart_1", None, True),
    ],
)
def test_what_is_said_to_repeat_does_within_the_way(effect, where, period, repeats):
    candidate = next(c for c in catalogue() if c.name == (effect, where))
    runs = [SimpleNamespace(track=np.array([[0.0, 60.0], [0.0, 50.0]]))]
    rival = SimpleNamespace(candidate=candidate, fit=SimpleNamespace(values={candidate.period: period}))
    assert rounds._repeats(SimpleNamespace(runs=runs, parts=False), rival) is repeats


@pytest.mark.parametrize(("width", "vanishes"), [(1.0, True), (1.1, False), (500.0, False)])
def test_a_hump_without_width_is_no_hump(width, vanishes):
    candidate = next(c for c in catalogue() if c.name == ("stribeck", "cart_1"))
    assert candidate.vanishes({"stribeck.cart_1.vs": width}) is vanishes


def test_what_is_hopeless_after_its_first_refit_is_not_refitted_again(monkeypatch):
    done = []
    fit = SimpleNamespace(
        weighted=2.0, cost=2.0, beside=lambda *_: 0.001, bare=lambda: "a fit", values={"quadratic_drag.cart_1.c": 0.1}
    )
    monkeypatch.setattr(rounds, "refit", lambda *a, **k: done.append(a) or fit)
    model = SimpleNamespace(values={}, names=(), weighted=1.0, cost=1.0)
    bench = SimpleNamespace(offsets=np.zeros(2), unplaced=lambda _: False, views=("comparable", "weighted"))
    candidate = next(c for c in catalogue() if c.name == ("quadratic_drag", "cart_1"))
    screened = SimpleNamespace(candidate=candidate, sizes=tuple(1e-6 for _ in candidate.sizes))
    rival = rounds._rival(bench, model, screened, np.zeros(4), lambda gains: max(gains) < 0.01)
    assert len(done) == 1
    assert rival.gains == (0.001, 0.001)

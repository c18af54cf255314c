"""The mixture of a study is the documented one, spread over effects and sizes, and follows from its seed."""

from collections import Counter

import pytest

from baselines.blind_study.plan import plan
from baselines.rig_simulator.catalogue import CATALOGUE, OUTSIDE
from baselines.rig_simulator.truth import MIXTURE, SIZES


def test_two_hundred_trials_hold_the_mixture_and_every_effect():
    trials = plan(200)
    kinds = Counter(t.kind for t in trials)
    assert kinds == {kind: round(200 * share) for kind, share in MIXTURE.items()}
    assert {t.effect[0] for t in trials if t.kind == "effect"} == {m.id for m in CATALOGUE}
    assert {t.effect[0] for t in trials if t.kind == "outside"} == {m.id for m in OUTSIDE}
    sizes = Counter(t.size for t in trials if t.kind == "effect")
    assert set(sizes) == set(SIZES)
    assert max(sizes.values()) - min(sizes.values()) <= 8


def test_every_effect_meets_every_size_before_one_comes_again():
    trials = [t for t in plan(600) if t.kind == "effect"]
    for id_ in {t.effect[0] for t in trials}:
        sizes = Counter(t.size for t in trials if t.effect[0] == id_)
        assert max(sizes.values()) - min(sizes.get(s, 0) for s in SIZES) <= 1


def test_the_seed_decides_everything():
    assert plan(40, seed=3) == plan(40, seed=3)
    assert [t.seed for t in plan(40, seed=3)] != [t.seed for t in plan(40, seed=4)]
    assert [t.number for t in plan(40)] == list(range(40))


def test_no_trials_are_refused():
    with pytest.raises(ValueError, match="trials: must be at least 1; got 0"):
        plan(0)

"""What stays beside all other effects when rounds are over."""

from types import SimpleNamespace

import numpy as np
import pytest

from identification.mismatch.candidates.catalogue import Candidate
from identification.mismatch.selection import selector
from identification.mismatch.selection.ranking import Scored
from identification.mismatch.selection.selector import Selection, Selector
from identification.mismatch.settings import Settings

LEVEL = 0.01


@pytest.fixture
def stay(monkeypatch):
    """Names that stay, from name to how rare its gain was when it was taken, and beside all others."""
    monkeypatch.setattr(selector, "fit", lambda *_: SimpleNamespace(values={}, names=()))

    def run(names, share=0.1):
        then = [Scored(Candidate(n, "guide", ((n, 1.0),)), None, np.ones(4), 1, p) for n, (p, _) in names.items()]
        asked = SimpleNamespace(bench=SimpleNamespace(pool=SimpleNamespace(map=map)), level=LEVEL)
        asked._without = lambda s, _step, model, last: (names[s.name[0]][1], model)
        asked._share = lambda *_: share
        last = SimpleNamespace(noise=None, base=None)
        taken, _ = Selector._backward(asked, [(s, last) for s in then], SimpleNamespace(values={}, names=()), last)
        return [s.name[0] for s, _ in taken]

    return run


def test_what_no_longer_predicts_is_left_out_again(stay):
    assert stay({"one": (0.002, 0.002), "other": (0.002, 0.3)}) == ["one"]


def test_what_stands_for_a_free_function_stays_while_it_is_as_rare_as_it_was(stay):
    # it was taken for the function's p-value, not for its own
    assert stay({"one": (0.002, 0.002), "other": (0.03, 0.03)}) == ["one", "other"]
    assert stay({"one": (0.002, 0.002), "other": (0.03, 0.04)}) == ["one"]


def test_what_brings_the_simulation_near_stays(stay):
    # draws around a model that is far away gain anything
    assert stay({"one": (0.002, 0.002), "other": (0.28, 0.3)}, share=0.9) == ["one", "other"]


@pytest.mark.parametrize(
    ("taken", "odd", "kept"),
    [
        (["one", "other"], {"one"}, ["other"]),
        (["one", "other"], {"other"}, ["one"]),
        # a refinement needs the dry friction that it refines
        (["coulomb_friction", "stribeck"], {"coulomb_friction"}, ["coulomb_friction", "stribeck"]),
    ],
)
def test_what_has_another_size_in_every_experiment_is_left_out(monkeypatch, taken, odd, kept):
    monkeypatch.setattr(selector, "differs", lambda _model, candidate, _level: candidate.id in odd)
    asked = SimpleNamespace(level=LEVEL, _without=lambda s, _step, model, last: (1.0, model))
    items = [(Scored(Candidate(n, "cart_1", ((n, 1.0),)), None, np.ones(4), 1), None) for n in taken]
    found, _ = Selector._of_one_size(asked, items, SimpleNamespace(), None)
    assert [s.name[0] for s, _ in found] == kept


@pytest.mark.parametrize(("p", "told"), [(0.05, "tilt"), (0.3, None)])
def test_what_is_likely_and_not_significant_is_told(p, told):
    tilt = Scored(Candidate("tilt", "guide", (("tilt.F", 1.0),)), None, np.ones(4), 1, 0.002, p)
    bench = SimpleNamespace(settings=Settings())
    chosen = SimpleNamespace(
        rounds=[SimpleNamespace(accepted=False, scored=[tilt])], model=SimpleNamespace(bench=bench), level=LEVEL
    )
    doubtful = Selection.doubtful.fget(chosen)
    assert (None if doubtful is None else doubtful.name[0]) == told


@pytest.mark.parametrize(("share", "named"), [(0.0, []), (0.002, ["load_friction"])])
def test_a_name_that_no_simulation_needs_is_not_given(monkeypatch, share, named):
    """Innovations tell laws apart within milliseconds, and so they name what is like the law that acts.

    What brings no experiment nearer that is left out takes off nothing.
    """
    like = Scored(Candidate("load_friction", "cart_2", (("mu", 1.0),)), None, np.ones(4), 1, 0.002)
    monkeypatch.setattr(selector, "fit_base", lambda *_: "base")
    first, last = (
        SimpleNamespace(base="base", accepted=accepted, best=like, scored=[like], null=None, variability=())
        for accepted in (True, False)
    )
    first.with_first = lambda _: first
    rounds = iter((first, last))
    asked = SimpleNamespace(bench=None, topology=None, known={}, level=LEVEL, settings=Settings())
    asked.say, asked._proposed, asked._near = lambda _: None, lambda _: [], lambda *_: None
    asked._significant, asked._share = lambda *_: [like], lambda *_: share
    asked._round, asked._name = lambda *_: next(rounds), lambda *a: Selector._name(asked, *a)
    asked._backward = asked._of_one_size = lambda taken, model, _last: (taken, model)
    assert [s.name[0] for s, _ in Selector.run(asked).accepted] == named


def test_a_speed_without_sign_adds_up_to_no_place():
    """What repeats along the way of such a cart is not looked for, unless its position was recorded."""
    key = "position_friction.cart_2"
    wave = Candidate("position_friction", "cart_2", ((f"{key}.a_sin", 0.1),), ((f"{key}.P", 50.0),))
    drag = Candidate("quadratic_drag", "cart_2", (("quadratic_drag.cart_2.c", 1e-5),))

    def looked_for(candidate, counter, x2=None):
        asked = SimpleNamespace(bench=SimpleNamespace(recordings=[SimpleNamespace(x1=None, x2=x2)]))
        return Selector._placed(asked, candidate, {("rectified_sensor", counter)})

    assert not looked_for(wave, "encoder_2")
    assert looked_for(wave, "encoder_1")
    assert looked_for(wave, "encoder_2", x2=np.zeros(3))
    assert looked_for(drag, "encoder_2")


@pytest.mark.parametrize(
    ("gained", "share", "beyond", "named"),
    [
        (1000.0, 0.02, False, True),
        (3000.0, 0.02, False, False),
        (3000.0, 0.02, True, True),
        (3000.0, 0.002, True, False),
        (3000.0, 0.3, False, True),
    ],
)
def test_what_a_law_that_is_inexact_leaves_is_no_other_effect(gained, share, beyond, named):
    """A gain goes with the square of a force: seven per cent of the force that is named have half a per cent of its gain.

    What brings the simulation near is another effect all the same, and so is what takes as much off it beside the earlier name:
    an encoder that plays gains by milliseconds what a brake never can.
    """
    offset = Scored(Candidate("input_offset", "actuator", (("u0", 1.0),)), None, np.full(12, 1.0), 1, 0.004)
    asked = SimpleNamespace(settings=Settings(), _significant=lambda *_: [offset], _share=lambda *_: share)
    asked._beyond = lambda *_: beyond
    step = SimpleNamespace(scored=[offset], best=offset, null=None, base=None)
    assert offset.total == pytest.approx(11.0)
    assert (Selector._name(asked, step, None, gained) is offset) == named


@pytest.mark.parametrize(("share", "beyond"), [(0.03, False), (0.05, True)])
def test_what_a_name_takes_off_is_held_against_what_the_names_before_it_took_off(monkeypatch, share, beyond):
    """Of a squared output error of 1,000 names took 900 off: half a per cent of that is 4.5, a share of 0.045 of what is left."""
    cost = {"before": 1000.0, "with them": 100.0}
    monkeypatch.setattr(selector.Levels, "of", lambda *_: None)
    monkeypatch.setattr(
        selector, "held_first", lambda _bench, _levels, values, _names: SimpleNamespace(cost=cost[values])
    )
    before, base = (SimpleNamespace(values=v, names=(), residual=None) for v in cost)
    asked = SimpleNamespace(bench=None, settings=Settings())
    assert Selector._beyond(asked, SimpleNamespace(fit=base), share, base, before) == beyond

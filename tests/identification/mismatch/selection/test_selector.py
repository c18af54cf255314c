"""What stays beside all other effects when rounds are over."""

from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from identification.mismatch.candidates.catalogue import Candidate
from identification.mismatch.selection import selector
from identification.mismatch.selection.naming import Naming
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
        naming = SimpleNamespace(share_beside=lambda *_: share)
        asked = SimpleNamespace(bench=SimpleNamespace(pool=SimpleNamespace(map=map)), level=LEVEL, naming=naming)
        asked._without = lambda s, _step, model, last: (names[s.name[0]][1], model)
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


def test_what_keeps_the_simulation_near_stays(stay):
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


@pytest.mark.parametrize(("p", "named", "told"), [(0.05, False, "tilt"), (0.3, False, None), (0.05, True, None)])
def test_what_is_likely_and_not_significant_is_told(p, named, told):
    """But for another size of what has a name."""
    tilt = Scored(Candidate("tilt", "guide", (("tilt.F", 1.0),)), None, np.ones(4), 1, 0.002, p)
    bench = SimpleNamespace(settings=Settings())
    chosen = SimpleNamespace(
        rounds=[SimpleNamespace(accepted=False, scored=[tilt])],
        model=SimpleNamespace(bench=bench),
        level=LEVEL,
        accepted=[(tilt, None)] if named else [],
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
    naming = SimpleNamespace(bench=SimpleNamespace(settings=Settings()), share_of_first=lambda *_: share)
    naming.significant, naming.name = lambda *_: [like], partial(Naming.name, naming)
    asked._round, asked.naming = lambda *_: next(rounds), naming
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


@pytest.mark.parametrize(("share", "where"), [(0.1, None), (0.6, "cart 2")])
def test_forces_nearly_as_large_as_they_may_be_hide_more(monkeypatch, share, where):
    monkeypatch.setattr(selector, "of_most", lambda _: np.array([[0.05, share], [0.0, 0.02]]))
    selection = Selection((SimpleNamespace(noise=None),), None, None, (), (), LEVEL)
    assert selection.hiding == where


@pytest.mark.parametrize(("names", "taken", "ended"), [([1, 2, 3], 2, False), ([1, None], 1, True), ([None], 0, True)])
def test_a_search_that_comes_to_its_most_rounds_has_not_ended(monkeypatch, names, taken, ended):
    """What is left then is not known, and nobody may say that nothing is."""
    found = [n and SimpleNamespace(name=("tilt", str(n)), total=9.0, variability=(), fit=None) for n in names]
    step = SimpleNamespace(base=None, best=SimpleNamespace(name=("tilt", "guide")), accepted=True, variability=())
    step.with_first = lambda _: step
    monkeypatch.setattr(selector, "fit_base", lambda *_: None)
    monkeypatch.setattr(selector, "nameless", lambda _: False)
    asked = SimpleNamespace(
        settings=Settings(rounds=2), naming=SimpleNamespace(name=lambda *_: found.pop(0)), say=lambda _: None,
        bench=None, topology=None, known={}, level=LEVEL, _proposed=lambda _: [], _near=lambda *_: None,
        _round=lambda *_: step, _backward=lambda taken, base, _: (taken, base), _of_one_size=lambda taken, base, _: (taken, base),
    )  # fmt: skip
    selection = Selector.run(asked)
    assert len(selection.accepted) == taken
    assert selection.ended == ended

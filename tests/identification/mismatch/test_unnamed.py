"""What the recordings are sure of and no name fits is said, not left out."""

from types import SimpleNamespace

import pytest

from identification.mismatch.comes_again import Again
from identification.mismatch.proof import Proof
from identification.mismatch.unnamed import nearly_named


def refused(name, learnt, kept, steady, **again):
    step = SimpleNamespace(rival=SimpleNamespace(name=name), view="comparable", probability=0.008, suspected=False)
    return Proof(step, 8.0, 8.0, learnt, learnt, kept, 1.01, steady=steady, again=again)


def test_what_recordings_foretell_of_one_another_is_said_though_its_name_does_not_stand():
    found = nearly_named([refused(("dead_zone", "actuator"), 0.06, 0.015, 2.4)])
    assert (found.where, found.share_of_error) == ("actuator", 0.06)
    assert found.nearest == (("dead_zone", pytest.approx(0.5)),)
    assert "t = 2.4" in found.acts_on


def test_what_comes_again_but_not_as_large_only_resembles_its_name():
    seen = Again(1.93, 0.29, 0.004)
    proof = refused(("input_offset", "actuator"), 0.0097, 0.0143, 0.3, comparable=seen)
    assert not proof.holds
    assert "1.9 times as large" in nearly_named([proof]).acts_on


def test_of_some_refused_names_the_one_that_explains_most_is_the_nearest():
    names = [refused(("stribeck", "cart_2"), 0.046, 0.02, 2.4), refused(("quadratic_drag", "cart_2"), 0.045, 0.02, 2.3)]
    assert nearly_named(names).nearest[0][0] == "stribeck"


@pytest.mark.parametrize(("learnt", "kept", "steady"), [(0.06, 0.02, 1.3), (0.004, 0.02, 3.0), (0.022, -0.006, 2.4)])
def test_what_chance_may_have_made_is_not_said(learnt, kept, steady):
    assert nearly_named([refused(("dead_zone", "actuator"), learnt, kept, steady)]) is None

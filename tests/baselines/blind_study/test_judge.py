"""What counts as named, as a tie, as false: the rules of a concealed trial."""

import pytest

from baselines.blind_study.judge import judge
from tests.baselines.blind_study.outcomes import effect, finding, outcome


def test_an_effect_is_named_by_id_and_place():
    said = judge(outcome("effect", [effect("stribeck", "cart_1")], [finding("stribeck", "cart_1")]))
    assert said.concealed[0].named == "exact"
    assert said.false_names == ()


def test_the_right_effect_at_the_wrong_place_is_a_miss_and_a_false_name():
    said = judge(outcome("effect", [effect("stribeck", "cart_1")], [finding("stribeck", "cart_2")]))
    assert said.concealed[0].named == "missed"
    assert said.false_names == ("stribeck@cart_2",)


def test_a_tie_that_lists_the_effect_is_no_false_name():
    tied = finding("input_offset", "actuator", ties=[("tilt", "guide")])
    said = judge(outcome("effect", [effect("tilt", "guide", pull_1=0.03, pull_2=0.02)], [tied]))
    assert said.concealed[0].named == "tie"
    assert said.false_names == ()


def test_one_tie_answers_for_one_effect_only():
    tied = finding("input_offset", "actuator", ties=[("tilt", "guide"), ("stribeck", "cart_1")])
    pair = [effect("tilt", "guide"), effect("stribeck", "cart_1")]
    assert [c.named for c in judge(outcome("pair", pair, [tied])).concealed] == ["tie", "missed"]


def test_any_name_is_false_where_nothing_or_an_outside_effect_is_concealed():
    assert judge(outcome("null", [], [finding("tilt", "guide")])).false_names == ("tilt@guide",)
    outside = judge(outcome("outside", [effect("slew_limit", "outside")], [finding("tilt", "guide")]))
    assert outside.outside == "slew_limit"
    assert outside.concealed == ()
    assert outside.false_names == ("tilt@guide",)


def test_a_fault_is_found_where_encoder_recording_and_time_agree():
    true = {"recording": "sine_2.5V_1.0Hz", "where": "encoder_1", "start_s": 2.0, "end_s": 2.1}
    same = {"recording": "sine_2.5V_1.0Hz", "where": "encoder_1", "start_s": 2.01, "end_s": 2.3}
    for change, found in ({}, 1), ({"where": "encoder_2"}, 0), ({"start_s": 3.0, "end_s": 3.1}, 0):
        said = judge(outcome("fault", faults=[true], found_faults=[{**same, **change}]))
        assert (said.faults, said.faults_found, said.false_faults) == (1, found, 1 - found)


def test_parameters_are_compared_where_they_mean_the_same():
    delay = finding("encoder_delay", "encoder_2", parameters={"tau": (0.0042, (0.0039, 0.0045))})
    said = judge(outcome("effect", [effect("encoder_delay", "encoder_2", late2=0.004)], [delay]))
    (known,) = said.effects
    assert known.error == pytest.approx(0.05)
    assert known.inside
    stiffness = next(k for k in said.base if k.name == "k")
    assert stiffness.error == pytest.approx(-0.525)
    assert not stiffness.inside


def test_a_diagnosis_that_fails_is_a_miss():
    said = judge(outcome("effect", [effect("stribeck", "cart_1")], failed="ValueError: no"))
    assert said.concealed[0].named == "missed"
    assert said.failed == "ValueError: no"

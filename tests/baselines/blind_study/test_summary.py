"""Figures of a study, on outcomes made by hand."""

import html
import re

import pytest

from baselines.blind_study.judge import judge
from baselines.blind_study.summary import headline, missed_or_false, summarise
from baselines.report.trial_page import build_trial_page
from tests.baselines.blind_study.outcomes import effect, finding, outcome


def study():
    outcomes = [outcome("null"), outcome("null", findings=[finding("tilt", "guide")]), outcome("null", unnamed=True)]
    outcomes.append(outcome("outside", [effect("slew_limit", "outside")], unnamed=True))
    for size in (0.25, 0.5, 1.0, 2.0):
        named = [finding("stribeck", "cart_1")] if size > 0.4 else []
        outcomes.append(outcome("effect", [effect("stribeck", "cart_1", size)], named))
        named = [finding("tilt", "guide", ties=[("input_offset", "actuator")])] if size > 0.9 else []
        outcomes.append(outcome("effect", [effect("input_offset", "actuator", size, offset=0.05)], named))
    pair = [effect("stribeck", "cart_1"), effect("tilt", "guide")]
    outcomes.append(outcome("pair", pair, [finding("tilt", "guide")]))
    return [judge({**o, "trial": {"number": i}}) for i, o in enumerate(outcomes)]


def test_rates_count_what_they_say():
    s = summarise(study())
    assert (s.named.hits, s.named.trials) == (5, 6)
    assert (s.exact.hits, s.exact.trials) == (3, 6)
    assert (s.null_names.hits, s.null_alarms.hits, s.null_alarms.trials) == (1, 2, 3)
    assert (s.pairs_both.hits, s.pairs_one.hits) == (0, 1)
    assert s.outside_unnamed.hits == 1
    assert s.by_size[0.25].hits == 0
    assert s.gain_error["diagnosed"] == pytest.approx(0.05)
    assert s.over_floor == pytest.approx((2.0, 1.1))
    assert s.null_over_floor == pytest.approx(2.0)
    # seven parameters of each null
    assert s.null_inside.trials == 21


def test_the_detection_limit_lies_between_what_was_missed_and_what_was_named():
    found = {d.name: d for d in summarise(study()).detection}
    assert 0.2 < found["stribeck"].half < 0.6
    assert found["stribeck"].half < found["input_offset"].half < 1.2
    assert found["stribeck"].nine_tenths > found["stribeck"].half


def test_the_confusion_counts_every_effect_once():
    table = summarise(study()).confusion
    assert table["stribeck@cart_1"] == {"stribeck@cart_1": 3, "nothing": 2}
    assert table["input_offset@actuator"] == {"in a tie": 2, "nothing": 2}
    assert table["nothing"] == {"nothing": 1, "tilt@guide": 1, "unnamed": 1}
    assert table["slew_limit"] == {"unnamed": 1}


def test_what_is_missed_or_false_is_said_trial_by_trial():
    found = missed_or_false(study())
    assert found[:2] == [
        ("1", "nothing", "tilt@guide", "tilt@guide false"),
        ("2", "nothing", "unnamed", "something unnamed where nothing is concealed"),
    ]
    assert found[-1] == ("12", "stribeck@cart_1 × 1; tilt@guide × 1", "tilt@guide", "stribeck@cart_1 missed")
    # right answers, a right one in a tie, and what is rightly unnamed are not in the list
    assert {number for number, *_ in found}.isdisjoint({"0", "3", "6", "8", "9", "10", "11"})


def test_an_outside_effect_that_is_not_noticed_and_an_encoder_that_stays_broken_are_wrong():
    outside = judge(outcome("outside", [effect("slew_limit", "outside")]))
    assert (outside.truth, outside.answer, outside.wrong) == (
        "slew_limit × 1",
        "nothing",
        ("slew_limit not noticed",),
    )
    fault = {"encoder": "encoder_1", "recording": "a", "start": 1.0, "end": 1.5}
    assert judge(outcome("fault", faults=[fault])).wrong == ("1 of 1 broken encoders not found",)
    failed = judge(outcome("effect", [effect("tilt", "guide")], failed="no fit"))
    assert (failed.answer, failed.wrong) == ("no fit", ("tilt@guide missed",))


def test_the_page_says_what_was_run():
    trials = study()
    page = build_trial_page(summarise(trials), trials, command="flexdrive blind --trials 13", engine="abc")
    assert "flexdrive blind --trials 13" in page
    # terms of the glossary are links where they first stand
    plain = html.unescape(re.sub(r"</?a\b[^>]*>", "", page))
    for what, value, _ in headline(summarise(trials)):
        assert what in plain
        assert value.split("(")[0].strip() in page


def test_errors_of_the_critical_gain_are_per_cent():
    rows = {what: (value, aim) for what, value, aim in headline(summarise(study()))}
    assert rows["median error of the critical gain, diagnosed drive"] == ("5.0%", "≤ 5 %")
    assert rows["median error of the critical gain, handout's tied fit"] == ("50.0%", "")
    nulls = {what: value for what, value, _ in headline(summarise([judge(outcome("null"))]))}
    assert nulls["median error of the critical gain, diagnosed drive"] == "–"


def test_a_limit_that_a_drive_does_not_see_is_infinitely_wrong():
    blind, right = (
        outcome("effect", [effect("stribeck", "cart_1")], [finding("stribeck", "cart_1")]) for _ in range(2)
    )
    blind["answer"]["critical_gains"] = {**blind["answer"]["critical_gains"], "diagnosed": None}
    assert summarise([judge(blind)]).gain_error["diagnosed"] == float("inf")
    assert summarise([judge(o) for o in (right, blind, right)]).gain_error["diagnosed"] == pytest.approx(0.05)


def test_a_study_of_nulls_alone_has_no_rates_of_naming():
    s = summarise([judge(outcome("null"))])
    assert s.named is None
    assert s.detection == ()
    assert build_trial_page(s, [judge(outcome("null"))], command="c", engine="e")

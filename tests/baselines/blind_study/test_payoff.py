"""What a better model pays on a concealed rig: the figures of one rig, their JSON form, and medians over rigs."""

import json
from dataclasses import replace

import numpy as np
import pytest

from baselines.blind_study.payoff import Outcome, Payoff, law_of, payoff
from baselines.blind_study.payoff_summary import summary, tables
from baselines.blind_study.sim_to_real import Gap, closings, gaps, mean_gaps
from baselines.controllers import design
from baselines.loop_analysis.margins import margins
from baselines.loop_analysis.stability_limit import with_rig
from baselines.rig_simulator.critical_gain import critical_gain, gain_margin
from baselines.rig_simulator.truth import draw_truth
from baselines.rl.agents import Agent
from flexdrive_gym import Drive

NULL = draw_truth(2, "null")
BASE = Drive(dict(NULL.drive))


@pytest.fixture(scope="module")
def found():
    stiff = BASE.replace({"k": 1.1 * BASE["k"]})
    return payoff(NULL, {"tied": stiff, "diagnosed": BASE}, ("p_x2_half", "lab4_ahead"))


def test_half_of_the_right_critical_gain_leaves_a_margin_of_two(found):
    right, wrong = found.find("diagnosed", "p_x2_half"), found.find("tied", "p_x2_half")
    assert right.gain_margin == pytest.approx(2.0, rel=0.03)
    # the margin is what the prediction is wrong by
    predicted = found.predicted_critical_gain["tied"]
    assert wrong.gain_margin == pytest.approx(2.0 * found.true_critical_gain / predicted, rel=0.03)
    assert found.true_critical_gain == critical_gain(NULL)
    assert right.predicted_margin == wrong.predicted_margin == 2.0


def test_the_right_model_tracks_better_and_all_are_stable(found):
    right, wrong = found.find("diagnosed", "lab4_ahead"), found.find("tied", "lab4_ahead")
    assert right.rms < wrong.rms
    assert right.linear_margin == pytest.approx(right.predicted_margin, rel=0.05)
    assert all(o.stable and 0.0 < o.rms < o.peak and o.effort > 0.0 for o in found.outcomes)


def test_it_survives_json(found):
    assert Payoff.from_json(json.loads(json.dumps(found.as_json()))) == found


def test_a_drive_without_a_second_cart_is_refused_and_said():
    rigid = Drive({"m1": 1e-3, "b1": 0.01})
    result = payoff(replace(NULL, effects=()), {"tied": rigid}, ("p_x2_half", "lab4"))
    assert [bool(o.refused) for o in result.outcomes] == [True, True]
    assert "second cart" in result.outcomes[1].refused
    assert result.find("tied", "lab4") is None


def test_an_unknown_design_is_refused():
    with pytest.raises(ValueError, match="designs: must be among p_x2_half"):
        payoff(NULL, {"free": BASE}, ("lab5",))


def test_without_dry_friction_the_margin_is_linear_theorys():
    rig = with_rig(BASE)
    controller = design("lab4", rig).controller
    expected = margins(rig, controller).gain_margin
    assert gain_margin(NULL, law_of(controller), friction=False) == pytest.approx(expected, rel=0.04)


def case(diagnosed, free, predicted=0.2):
    outcomes = [Outcome("free", "p_x2_half", free, 2 * free, 1.0, stable=True, gain_margin=1.5, linear_margin=1.1)]
    if diagnosed is None:
        outcomes.append(Outcome("diagnosed", "p_x2_half", refused="drive: …"))
    else:
        outcomes.append(Outcome("diagnosed", "p_x2_half", diagnosed, 9.0, 1.0, stable=diagnosed < 5.0, gain_margin=2.0))
    return Payoff(0.25, {"free": predicted, "diagnosed": 0.25}, tuple(outcomes))


def test_ratios_are_paired_and_refusals_counted():
    (row,) = summary([case(1.0, 2.0), case(3.0, 4.0), case(None, 1.0), case(6.0, 6.0)])
    assert row.ratios["diagnosed/free"].value == pytest.approx(0.75)
    assert row.ratios["diagnosed/free"].n == 3
    assert row.ratios["diagnosed/free"].low <= 0.75 <= row.ratios["diagnosed/free"].high
    assert row.drives["diagnosed"].refused == 1
    assert row.drives["diagnosed"].stable == pytest.approx(0.5)
    assert row.drives["free"].rms == pytest.approx(3.0)
    assert row.drives["free"].margin == pytest.approx(1.5)
    assert row.gain_errors["free"].value == pytest.approx(0.2)
    assert row.gain_errors["diagnosed"].value == pytest.approx(0.0)


def test_the_tables_say_by_how_much():
    (columns, (row,)), (_, margins) = tables(summary([case(1.0, 2.0), case(3.0, 4.0)]))
    said = dict(zip(columns, row, strict=True))
    assert said["rms on the diagnosed drive [mm]"] == "2.00"
    assert said["rms on the free drive [mm]"] == "3.00"
    assert said["rms diagnosed/free"].startswith("0.625")
    assert [made_on for _, made_on, *_ in margins] == ["free", "diagnosed"]
    assert {design for design, *_ in margins} == {"p_x2 at half the predicted critical gain"}


def p_agent(gain):
    """A policy that is P-control from x2."""
    weights = np.zeros((1, 8))
    weights[0, 2] = gain / 8.0
    return Agent("p", [(weights, np.zeros(1))], "tanh", {"sensing": "non_collocated"})


def test_an_agent_that_is_p_control_does_on_the_rig_what_p_control_does():
    half = 0.5 * critical_gain(NULL)
    found = payoff(NULL, {"tied": BASE}, ("p_x2_half",), {"tied": p_agent(half)})
    design, agent = found.find("tied", "p_x2_half"), found.find("tied", "agent")
    assert agent.rms == pytest.approx(design.rms, rel=0.05)  # the agent acts every 5 ms, the design every 1 ms
    assert agent.stable
    assert agent.margin is None
    assert Payoff.from_json(json.loads(json.dumps(found.as_json()))) == found
    with pytest.raises(ValueError, match="agents: must belong to tied; got free"):
        payoff(NULL, {"tied": BASE}, (), {"free": p_agent(half)})


def test_the_gap_is_what_the_rig_is_off_the_promise():
    """A drive with far too little friction promises P-control an error that the rig does not keep."""
    slippery = BASE.replace({"d1": 0.3 * BASE["d1"], "d2": 0.3 * BASE["d2"]})
    agent = p_agent(0.4 * critical_gain(NULL))
    free, diagnosed = gaps(NULL, {"free": slippery, "diagnosed": BASE}, {"free": agent, "diagnosed": agent})
    assert free.reached == diagnosed.reached  # the same agent on the same rig
    assert free.promised < diagnosed.promised
    assert diagnosed.gap < 0.5 * free.gap


def test_closings_are_paired():
    rigs = [
        [Gap("tied", 1.0, 3.0, True), Gap("diagnosed", 1.0, 1.5, True)],
        [Gap("tied", 1.0, 2.0, True), Gap("diagnosed", 1.0, 1.5, True)],
        [Gap("tied", 1.0, None, False), Gap("diagnosed", 1.0, 1.0, True)],
    ]
    (found,) = closings(rigs)
    assert (found.better, found.other, found.closed.n) == ("diagnosed", "tied", 2)
    assert found.closed.value == pytest.approx((0.75 + 0.5) / 2)
    assert found.ratio.value == pytest.approx((0.5 + 0.75) / 2)


def test_nothing_tried_has_no_rows():
    assert [rows for _, rows in tables(())] == [[], []]


def test_gaps_of_several_trainings_are_those_of_their_means():
    one, two = Gap("free", 1.0, 2.0, stable=True), Gap("free", 2.0, 6.0, stable=True)
    assert mean_gaps([(one,), (two,)]) == (Gap("free", 1.5, 4.0, stable=True),)
    lost = Gap("free", 1.0, None, stable=False)
    assert mean_gaps([(one,), (lost,)]) == (Gap("free", 1.0, None, stable=False),)

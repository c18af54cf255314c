"""Comparisons are paired, repeatable, and the same wherever they are computed."""

import base64
import os
import re
import signal
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.stats import binomtest

from baselines.compare import (
    Entry,
    agent_entries,
    behaviour,
    cases_of,
    compare,
    entries,
    headline,
    learnt_verdicts,
    named_reference,
    previewed_entries,
    summarise,
    typical_effects,
    where_it_loses,
)
from baselines.controllers import design
from baselines.evaluation.proportions import share
from baselines.loop_analysis.margins import margins
from baselines.loop_analysis.stability_limit import with_rig
from baselines.report.compare_page import build_compare_page
from baselines.report.teaching_page import build_teaching_page
from baselines.rl.agents import Agent, save_agent
from flexdrive_gym import Covariance, Drive
from flexdrive_gym.drive.effects import EFFECTS
from flexdrive_gym.references import sample_reference
from tests.drive.drives import RIG

SPREAD = np.diag([(0.05 * RIG[n]) ** 2 for n in ("m1", "m2", "k", "d1")])
DRIVE = Drive({**RIG, "saturation.limit": 8.0}, covariance=Covariance(("m1", "m2", "k", "d1"), SPREAD))


@dataclass
class BlackBox:
    """A black box, as a learnt policy is."""

    gain: float = 0.12

    def reset(self):
        pass

    def __call__(self, observation):
        return self.gain * (observation.xr - observation.x2)


def chosen():
    found, skipped = entries(DRIVE, ["p_x2", "lab4"])
    assert not skipped
    return found


def tables(comparison):
    return [r.measures for r in comparison.results]


def test_share_is_wilsons():
    for hits, n in ((0, 10), (7, 10), (500, 500), (13, 500)):
        ours = share([True] * hits + [False] * (n - hits))
        theirs = binomtest(hits, n).proportion_ci(method="wilson")
        assert (ours.low, ours.high) == pytest.approx((theirs.low, theirs.high), abs=1e-9)


@pytest.mark.slow
def test_every_backend_finds_the_same():
    cases = cases_of(DRIVE, draws=60, effects=False, references=(named_reference("sine"),), seed=1)
    reference = tables(compare(DRIVE, chosen(), cases=cases, empirical=False, backend="sequential"))
    for backend, jobs in (("threading", 2), ("loky", 2)):
        found = tables(compare(DRIVE, chosen(), cases=cases, empirical=False, backend=backend, jobs=jobs))
        assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(reference, found, strict=True))


def test_draws_are_the_seeds_and_the_same_for_all_controllers():
    a, b, c = (cases_of(DRIVE, draws=5, effects=False, seed=s) for s in (1, 1, 2))
    assert [x.drive.values for x in a] == [x.drive.values for x in b]
    assert a[1].drive["k"] != c[1].drive["k"]


def test_each_left_out_effect_is_a_case_and_what_the_drive_has_is_left():
    found = typical_effects(with_rig(DRIVE))
    names = {case.name.split(",")[0] for case in found}
    assert names <= {effect.id for effect in EFFECTS}
    assert "input_delay" in names
    assert not names & {"coulomb_friction", "viscous_friction", "spring", "saturation", "encoder_quantisation"}
    for case in found:
        assert dict(case.drive.values) != dict(with_rig(DRIVE).values)
        assert all(case.drive[n] == DRIVE[n] for n in RIG)


def test_a_black_box_is_measured_like_its_linear_twin(tmp_path):
    twins = [Entry("box", BlackBox(), "P-control nobody can look into", "x2"), *chosen()]
    cases = cases_of(DRIVE, draws=0, effects=False)
    found = compare(DRIVE, twins, cases=cases, duration=2.0, empirical=False, backend="sequential")
    box = found.results[0]
    assert box.margins is None
    assert box.draws is None
    assert box.nominal.rms == pytest.approx(found.results[1].nominal.rms, rel=0.2)
    assert box.unseen["sine"].rms == pytest.approx(found.results[1].unseen["sine"].rms, rel=0.2)
    assert headline(found)
    page = build_compare_page(found)
    assert "P-control nobody can look into" in page


def write_agents(folder, gains, sensing="non_collocated"):
    """Policies that are P-control, one file per gain."""
    paths = []
    for i, gain in enumerate(gains):
        weights = np.zeros((1, 8))
        weights[0, 2] = gain / 8.0
        agent = Agent("p", [(weights, np.zeros(1))], "tanh", {"sensing": sensing}, card={"steps": 3_000_000})
        paths.append(str(save_agent(agent, folder / f"{sensing}-{i}.npz")))
    return paths


@pytest.fixture(scope="module")
def with_agents(tmp_path_factory):
    """Classical designs at two sample times and learnt groups, on few cases."""
    folder = tmp_path_factory.mktemp("agents")
    paths = write_agents(folder, (0.1, 0.12, 0.14)) + write_agents(folder, (0.3,), "collocated")
    classical, _skipped = entries(DRIVE, ["p_x2", "lab4"], limit=8.0, periods=(1e-3, 5e-3))
    cases = cases_of(DRIVE, draws=6, references=(named_reference("sine"), named_reference("square")), seed=2)
    return compare(
        DRIVE, [*classical, *agent_entries(DRIVE, paths)], cases=cases, limit=8.0, duration=2.0, backend="sequential"
    )


def test_agents_of_one_kind_are_a_group_and_act_at_their_own_period(with_agents):
    groups = {g.name: [r.entry.period for r in g.results] for g in with_agents.groups}
    assert groups == {
        "p_x2": [1e-3], "lab4": [1e-3], "p_x2@5ms": [5e-3], "lab4@5ms": [5e-3], "rl_x2": [5e-3] * 3, "rl_x1": [5e-3],
    }  # fmt: skip
    assert "3 million steps" in with_agents.results[-1].entry.title


def test_an_agent_that_is_p_control_does_what_p_control_does(with_agents):
    """The tuned design at 5 ms and its gain in a policy file are the same loop, so their runs are the same to a count."""
    tuned = next(r for r in with_agents.results if r.entry.name == "p_x2@5ms")
    gain = -tuned.entry.controller.D[0, 2]
    closest = min(
        (r for r in with_agents.results if r.entry.group == "rl_x2"),
        key=lambda r: abs(r.nominal.rms - tuned.nominal.rms),
    )
    assert abs({0: 0.1, 1: 0.12, 2: 0.14}[int(closest.entry.name[-1])] - gain) < 0.011
    assert closest.on_rig.gain_margin == pytest.approx(tuned.on_rig.gain_margin, rel=0.25)
    assert closest.empirical is None


def test_cases_are_the_references_and_drives_asked_for(with_agents):
    assert with_agents.references == ("sine", "square")
    assert len(with_agents.where()) == 6
    assert len(with_agents.where(None, "sine")) == 6
    assert len(with_agents.where("nominal", "square")) == 1
    assert len(with_agents.where("effect")) == len(with_agents.results[0].effects)


def test_statistics_are_those_of_the_measures(with_agents):
    summaries, improvements = summarise(with_agents)
    rl = next(s for s in summaries if s.name == "rl_x2")
    assert rl.seeds == 3
    scores = np.sort(
        np.concatenate([r.measures[with_agents.where(), 0] for r in with_agents.results if r.entry.group == "rl_x2"])
    )
    assert rl.rms.value == pytest.approx(scores[4:-4].mean())
    against = {i.classical: i for i in improvements if i.learnt == "rl_x2"}
    assert set(against) == {"p_x2", "lab4", "p_x2@5ms", "lab4@5ms"}
    assert against["lab4"].rms.value == 0.0  # P-control never beats Lab 4
    assert 0.0 < against["p_x2@5ms"].rms.value < 1.0


@pytest.mark.slow
def test_sentences_and_pages_say_where_learning_loses(with_agents):
    summaries, improvements = summarise(with_agents)
    said = " ".join(learnt_verdicts(with_agents, summaries, improvements))
    assert re.search(r"rl_x2 \(3 training seeds\).*misses the aim of 50%.*loses against lab4, lab4@5ms", said)
    found = behaviour(with_agents)
    assert {s.name for s in found.shown} >= {"p_x2", "lab4", "non_collocated-1", "collocated-0"}
    why = " ".join(where_it_loses(with_agents, summaries, found))
    assert re.search(r"rl_x2 loses against lab4.*handout \(", why)
    assert "such an error is left where the carts stand" in why
    assert re.search(r"Beside lab4, rl_x2 is worse in .*gain margin with friction", why)
    assert "Its seeds differ on the identified drive" in why
    page = build_compare_page(with_agents)
    assert "Probability that rl_x2 is better" in page
    assert "Where learning loses, and why" in page


@pytest.mark.slow
def test_the_teaching_page_answers_with_a_learnt_last_column_and_small_pictures(with_agents):
    pytest.importorskip("pygame")
    page = build_teaching_page(with_agents)
    header = re.search(r"<th.*?</thead>", page[page.index('id="table"') :], re.DOTALL).group()
    assert re.findall(r"<th[^>]*>([^<]*)</th>", header.replace("<wbr>", ""))[-2:] == ["Lab 4", "RL (non_collocated-1)"]
    # a loop that swings is never called stable without saying so, and every margin has its name
    rows = {
        cells[0]: cells[1:]
        for row in re.findall(r"<tr>(.*?)</tr>", page[page.index('id="table"') :], re.DOTALL)
        if (cells := re.findall(r"<td[^>]*>([^<]*)</td>", row))
    }
    assert "stable" not in rows
    assert rows["linear loop"][:3] == ["stable", "unstable", "unstable"]
    assert rows["simulated with friction"][1].startswith("swings ")
    assert rows["simulated with friction"][2] == "grows"
    lab4 = design("lab4", with_agents.drive)
    assert float(rows["GM linear"][-2]) == pytest.approx(
        margins(with_agents.drive, lab4.controller).gain_margin, rel=0.01
    )
    assert float(rows["GM with friction"][-2]) > 2.0 * float(rows["GM linear"][-2])
    assert "simulated error of x2 in the dwells" in page
    assert "measured error" not in page
    moving = re.findall(r'<script type="text/plain">([^<]*)</script>', page)
    assert len(moving) == 6
    # ten pictures a second, both ends included
    sizes = [(len(frames.split(" ")), len(frames)) for frames in moving]
    assert all(count == round(10 * with_agents.duration) + 1 and size < 400_000 for count, size in sizes), sizes
    assert all(base64.b64decode(frame).startswith(b"\x89PNG") for frame in moving[0].split(" "))
    assert page.count('type="range"') == 6


def test_a_reference_by_name_is_the_environments():
    t = np.arange(0.0, 2.0, 1e-3)
    given = named_reference("sine:amplitude=5:frequency=2")
    assert np.array_equal(given.sampled(t), sample_reference(("sine", {"amplitude": 5.0, "frequency": 2.0}), t))
    assert str(given) == "sine:amplitude=5:frequency=2"
    assert str(named_reference("prbs")) == "prbs"
    assert np.array_equal(named_reference("prbs").sampled(t), named_reference("prbs").sampled(t))
    bits = named_reference("prbs").sampled(np.arange(0.0, 4.0, 1e-3))
    assert np.count_nonzero(np.diff(bits)) >= 4  # one change in four seconds would be a step
    for wrong, text in (("sinus", "Did you mean"), ("sine:amplitude", "keyword=number"), ("sine:high=2", "high")):
        with pytest.raises(ValueError, match=text):
            named_reference(wrong)


def test_a_design_may_have_the_preview_of_the_policies(tmp_path):
    """The lead tuned along random moves also helps along the handout's trajectory, and leaves the loop alone."""
    classical, _skipped = entries(DRIVE, ["p_x2", "lab4"], limit=8.0)
    learnt = agent_entries(DRIVE, write_agents(tmp_path, (0.1,)))
    (told,) = previewed_entries(DRIVE, classical, learnt)
    assert told.name == "lab4+preview"
    assert 0.0 < told.controller.lead <= 0.1
    cases = cases_of(DRIVE, draws=0, effects=False, references=())
    found = compare(DRIVE, [classical[1], told], cases=cases, limit=8.0, backend="sequential")
    without, with_it = found.results
    assert with_it.nominal.rms < without.nominal.rms
    assert with_it.margins == without.margins
    assert previewed_entries(DRIVE, classical, []) == []


def test_unknown_agents_are_refused(tmp_path):
    path = write_agents(tmp_path, (0.1,))[0]
    with pytest.raises(ValueError, match="agents: names must be unique"):
        agent_entries(DRIVE, [path, path])
    with pytest.raises(ValueError, match="name: must be among"):
        agent_entries(DRIVE, ["x3-0"])


def test_names_and_addresses_are_checked():
    entry = chosen()[0]
    with pytest.raises(ValueError, match="names must be unique"):
        compare(DRIVE, [entry, entry], cases=cases_of(DRIVE, draws=0, effects=False))
    with pytest.raises(ValueError, match=r"needs an address.*--scheduler"):
        compare(DRIVE, [entry], cases=cases_of(DRIVE, draws=0, effects=False), backend="dask")
    with pytest.raises(ValueError, match="backend: must be"):
        compare(DRIVE, [entry], cases=cases_of(DRIVE, draws=0, effects=False), backend="spark")


@pytest.mark.slow
@pytest.mark.filterwarnings("default")  # the client warns of the worker that is lost on purpose
def test_a_lost_dask_worker_loses_nothing(cluster):
    address, workers = cluster
    cases = cases_of(DRIVE, draws=200, effects=False, references=(), seed=1)
    here = tables(compare(DRIVE, chosen(), cases=cases, empirical=False, backend="sequential"))

    def lose_one(done, _all):
        if done == 3:
            os.kill(workers[0].pid, signal.SIGKILL)

    there = compare(DRIVE, chosen(), cases=cases, empirical=False, backend="dask", scheduler=address, progress=lose_one)
    workers[0].wait(timeout=10)
    assert workers[1].poll() is None
    assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(here, tables(there), strict=True))

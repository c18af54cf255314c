"""Maximum likelihood finds the drive that made the data, says how sure it is, and keeps what it is told."""

from dataclasses import replace

import numpy as np
import pytest

from flexdrive_gym import Drive, Fault
from identification.equation_error import start_values
from identification.likelihood import identify_by_likelihood, improvement
from identification.quantities import HANDOUT_RATIOS
from tests.drive.drives import RIG
from tests.each import each
from tests.identification.lab import COUNTS, data_set, run

NAMES = ("m1", "m2", "b1", "b2", "d1", "d2", "k")


@pytest.fixture(scope="module")
def data():
    return data_set()


@pytest.fixture(scope="module")
def fit(data):
    return identify_by_likelihood(data)


@each("name", NAMES)
def test_truth_lies_within_a_few_percent_and_near_the_interval(fit, name):
    low, high = fit.drive.intervals[name]
    width = high - low
    assert fit.drive[name] == pytest.approx(RIG[name], rel=0.05)
    assert low - width < RIG[name] < high + width


def test_equation_error_starts_close(data):
    start = start_values(data)
    assert all(start[name] == pytest.approx(RIG[name], rel=0.6) for name in NAMES)


def test_answer_does_not_depend_on_threads(data, fit):
    alone = identify_by_likelihood(data, threads=1)
    assert dict(alone.drive.values) == dict(fit.drive.values)
    assert alone.drive.intervals == fit.drive.intervals


def test_every_start_leads_to_the_same_valley(fit):
    costs = [cost for label, cost in fit.starts.items() if "refined" not in label]
    assert np.ptp(costs) < 0.01 * abs(np.mean(costs))


def test_ties_hold_and_cost_fit(data, fit):
    tied = identify_by_likelihood(data, ties=HANDOUT_RATIOS)
    assert tied.drive["m2"] == pytest.approx(0.54 * tied.drive["m1"])
    assert tied.drive["b2"] == pytest.approx(0.1 * tied.drive["b1"])
    assert tied.drive["d2"] == pytest.approx(0.1 * tied.drive["d1"])
    assert improvement(tied, fit) > 0.5  # this rig's ratios are far from the handout's


def test_masked_faults_do_not_move_the_estimate(data, fit):
    v1 = data[2].v1.copy()
    dead = slice(1200, 1500)
    v1[dead] = 0.0
    fault = Fault(data[2].name, "encoder_1", "encoder_dropout", 1.2, 1.499)
    broken = [*data[:2], replace(data[2], v1=v1, faults=(fault,)), *data[3:]]
    found = identify_by_likelihood(broken)
    for name in NAMES:
        low, high = fit.drive.intervals[name]
        assert abs(found.drive[name] - fit.drive[name]) < high - low


def test_intervals_narrow_with_more_data(data, fit):
    more = identify_by_likelihood([*data, *data_set(force=0.1), *data_set(force=0.1)])
    width = {k: np.diff(v)[0] for k, v in fit.drive.intervals.items()}
    assert np.median([np.diff(more.drive.intervals[k])[0] / width[k] for k in NAMES]) < 0.8


def test_intervals_know_that_friction_differs_from_run_to_run():
    spread = 0.1
    factors = 1.0 + spread * np.array([-1.2, 0.3, 1.3, -0.5, 0.9, -1.4, 0.6, -0.3, 1.0, -0.7])
    kinds = [("square", 1.5, 0.5), ("square", 2.0, 0.5), ("sine", 2.5, 1.0), ("sine", 2.5, 2.5), ("sine", 2.5, 4.0)]
    runs = [
        run(Drive({**RIG, **COUNTS, "d1": f * RIG["d1"]}), *kind, seed=i)
        for i, (f, kind) in enumerate(zip(factors, 2 * kinds, strict=True))
    ]
    found = identify_by_likelihood(runs).drive
    low, high = found.intervals["d1"]
    # ten runs tell their common level no better than the mean of ten draws does, however many samples they have
    assert high - low > 2.0 * 1.96 * spread * RIG["d1"] / np.sqrt(len(factors))
    assert low < RIG["d1"] < high


def test_few_recordings_have_intervals_and_a_warning(data):
    few = identify_by_likelihood(data[:3])
    assert all(low < few.drive[n] < high for n, (low, high) in few.drive.intervals.items())
    assert "with fewer than 9 recordings (here 3) the intervals hold little of" in few.drive.provenance.note


def test_coloured_residuals_are_worth_fewer_samples(fit):
    assert 0 < fit.effective_samples < fit.samples


def test_quantities_follow_from_the_drive(fit):
    q = fit.quantities
    assert q["bT"].value == pytest.approx(fit.drive["b1"] + fit.drive["b2"])
    assert q["omega_n"].value == pytest.approx(fit.drive.linear.omega_n)
    assert q["p"].ci95[0] < q["p"].value < q["p"].ci95[1]
    assert q["C"].value == 0.0


def test_one_cart_gives_a_rigid_drive():
    truth = Drive({"m1": 1.1e-3, "b1": 0.0127, "d1": 0.5, "encoder_quantisation.encoder_1.quantum": 0.0046592})
    runs = [run(truth, "square", a, 0.5, force=0.05, seed=i) for i, a in enumerate((1.5, 2.0))]
    found = identify_by_likelihood(runs).drive
    assert found.carts == 1
    assert found["m1"] == pytest.approx(1.1e-3, rel=0.02)
    assert found["d1"] == pytest.approx(0.5, rel=0.05)


def test_spring_damping_is_found_when_asked_for():
    found = identify_by_likelihood(data_set(Drive({**RIG, **COUNTS, "C": 8e-4}), force=0.02), damping=True)
    assert found.drive["C"] == pytest.approx(8e-4, rel=0.3)


@each("ties", [None, {"alpha": HANDOUT_RATIOS["alpha"]}])
def test_a_sensor_without_sign_leaves_a_drive_within_its_bounds(data, ties):
    # no drive moves so: the fit runs to a bound and says so, for a diagnosis must start from something
    found = identify_by_likelihood([replace(r, v2=np.abs(r.v2)) for r in data], ties=ties)
    assert all(found.drive[name] >= 1e-9 for name in ("m1", "m2", "k"))
    assert any("rests at its bound 1e-09: the model lacks" in note for note in found.notes)


def test_unknown_ties_are_refused(data):
    with pytest.raises(ValueError, match="ties: must be among alpha, beta, gamma; got 'delta'"):
        identify_by_likelihood(data, ties={"delta": 1.0})


def test_no_recordings_are_refused():
    with pytest.raises(ValueError, match="needs at least one run"):
        identify_by_likelihood([])


def test_freeing_the_ratios_cuts_the_error_on_the_real_rig(shared_recordings):
    from identification.recordings import read_recordings

    runs = read_recordings(shared_recordings / "mte360_2022")
    free, tied = identify_by_likelihood(runs), identify_by_likelihood(runs, ties=HANDOUT_RATIOS)
    assert improvement(tied, free) > 0.75


def test_a_quantity_has_one_interval_wherever_it_stands(fit):
    for name, bounds in fit.drive.intervals.items():
        assert fit.quantities[name].ci95 == pytest.approx(bounds, abs=0.0)
    assert all(q.ci95 is None or q.ci95[0] >= 0.0 for q in (*fit.quantities.values(), *fit.ratios.values()))

"""The whole diagnosis on generated data: power, calibration, and recordings that nothing is chosen by."""

from dataclasses import replace
from functools import cache
from importlib import import_module
from types import SimpleNamespace

import numpy as np
import pytest

from identification.mismatch.diagnose import _Result, diagnose
from identification.mismatch.fitting.fit import fit
from identification.mismatch.selection.naming import Naming
from identification.mismatch.selection.selector import Selector
from identification.recordings import RecordingSet, Rig
from tests.identification.mismatch.lab import QUICK, data_set

# what is asked here does not depend on how far many candidates are fitted
ONE_ROUND = replace(QUICK, rounds=1, proposals=2, finished=1)
EFFECTS = {
    "ground_spring": {"ground_spring.kg": 0.05},
    "input_delay": {"input_delay.tau": 0.006},
}
# one of them in all tests
PLAIN = ["ground_spring", pytest.param("input_delay", marks=pytest.mark.slow)]
NOTHING_OR_SOMETHING = [None, pytest.param("input_delay", marks=pytest.mark.slow)]


@cache
def _diagnosed(effect):
    return diagnose(_runs(effect), settings=QUICK, jobs=1)


def _runs(effect):
    return data_set(EFFECTS.get(effect), force=0.05)


@pytest.mark.parametrize("effect", PLAIN)
def test_a_plain_effect_is_named_or_tied_with_its_size(effect):
    found = _diagnosed(effect)
    names = [f.id for f in found.findings] + [t.id for f in found.findings for t in f.ties]
    assert effect in names
    first = found.findings[0]
    assert first.p_value <= 0.02
    assert found.after_rms < 0.7 * found.before_rms
    if first.id == effect:
        (key, true), *_ = EFFECTS[effect].items()
        assert first.parameters[key.split(".")[-1]].value == pytest.approx(true, rel=0.15)


@pytest.mark.parametrize("effect", PLAIN)
def test_findings_lead_from_the_base_model_to_the_reported_drive(effect):
    found = _diagnosed(effect)
    errors = [found.before_rms, *(f.report_rms_after for f in found.findings)]
    assert [f.report_rms_before for f in found.findings] == pytest.approx(errors[:-1])
    assert found.after_rms == pytest.approx(errors[-1])
    # what is named is in it
    assert all(key in found.drive.values for f in found.findings for key in f.keys)


@pytest.mark.slow
def test_what_was_left_out_again_is_in_no_finding(monkeypatch):
    """A ground spring was found beside play that was left out later: the spring alone leads to the reported drive."""
    chosen = Selector.run

    def run(self):
        selection = chosen(self)
        ((scored, step),) = selection.accepted
        play = "encoder_play.encoder_1.g"
        more = fit(self.bench, step.noise, {**scored.fit.values, play: 0.01}, (*scored.fit.names, play), iterations=1)
        return replace(selection, accepted=((replace(scored, fit=more), step),))

    monkeypatch.setattr(Selector, "run", run)
    found = diagnose(_runs("ground_spring"), settings=ONE_ROUND, jobs=1)
    (finding,) = found.findings
    assert finding.report_rms_after == pytest.approx(found.after_rms)


def test_what_no_simulation_needs_is_no_finding(monkeypatch):
    """Play of a few hundredths of a millimetre may predict milliseconds; a simulation is as good without."""
    chosen = Selector.run
    play = "encoder_play.encoder_1.g"

    def run(self):
        selection = chosen(self)
        ((scored, step),) = selection.accepted
        candidate = next(c for c in self.candidates if c.name == ("encoder_play", "encoder_1"))
        more = fit(self.bench, step.noise, {**scored.fit.values, play: 0.01}, (*scored.fit.names, play), iterations=1)
        later = replace(scored, candidate=candidate, fit=more)
        return replace(selection, model=more, accepted=((scored, step), (later, step)))

    monkeypatch.setattr(Selector, "run", run)
    found = diagnose(_runs("ground_spring"), settings=ONE_ROUND, jobs=1)
    assert [f.id for f in found.findings] == ["ground_spring"]
    assert play not in found.drive.values
    # one round named it, so nobody knows what another would
    assert found.verdict == "partly_explained"
    assert any(n.startswith("the search ended after 1 round,") for n in found.notes)


def test_what_is_named_beside_a_finding_is_no_tie(monkeypatch):
    module = import_module("identification.mismatch.diagnose")
    for name, value in {"velocity_rms": 1.0, "share_of": 0.5, "significance_of": 0.004, "_estimates": {}}.items():
        monkeypatch.setattr(module, name, lambda *_, value=value: value)
    tilt, bristles, asymmetry = (
        SimpleNamespace(name=name, fit=None, candidate=None)
        for name in (("tilt", "guide"), ("presliding", "cart_1"), ("coulomb_asymmetry", "cart_1"))
    )
    step, drive = SimpleNamespace(ties=lambda: [bristles, asymmetry]), SimpleNamespace(values={})
    found = SimpleNamespace(
        accepted=[(tilt, step), (bristles, step)], split=SimpleNamespace(report=()), runs=(), pool=None
    )
    finding = module._Result.finding(found, tilt, step, drive, drive, drive)
    assert [tie.id for tie in finding.ties] == ["coulomb_asymmetry"]


def test_a_look_alike_is_fitted_before_the_leader_is_named(monkeypatch):
    """A spring with play and one whose coils touch bend alike: where only the latter is proposed, the play is still found."""
    proposed = Selector._jobs

    def jobs(self, *given):
        return [job for job in proposed(self, *given) if job[0].id == "coil_bind"]

    monkeypatch.setattr(Selector, "_jobs", jobs)
    monkeypatch.setattr(Selector, "_seen_far", lambda *_: [])
    # nor is it fitted for its first-order gain
    runs = data_set({"coupling_backlash.g": 1.8}, force=0.05)
    found = diagnose(runs, settings=replace(ONE_ROUND, proposals=50, likely=0.0), jobs=1)
    (finding,) = found.findings
    assert "coupling_backlash" in {finding.id, *(t.id for t in finding.ties)}
    play = next(d for d in finding.drives if "coupling_backlash.g" in d.values)
    assert play["coupling_backlash.g"] == pytest.approx(1.8, rel=0.05)


@pytest.mark.slow
def test_a_name_that_no_simulation_needs_gives_way_to_the_next(monkeypatch):
    """Its share of the output error is asked within the round: what is skipped costs no round."""
    asked = []

    def share(_, scored, *_base_and_metric):
        asked.append(scored.name[0])
        return float(scored.name[0] != "ground_spring")

    monkeypatch.setattr(Naming, "share", share)
    found = diagnose(_runs("ground_spring"), settings=replace(ONE_ROUND, rounds=2), jobs=1)
    assert asked[0] == "ground_spring"
    assert "ground_spring" not in [f.id for f in found.findings]


def test_what_is_significant_and_not_needed_has_no_name(monkeypatch):
    """Something is there, and what comes nearest to it is not what it is: no simulation gets better by it."""
    monkeypatch.setattr(Naming, "share", lambda *_: 0.0)
    found = diagnose(_runs("ground_spring"), settings=ONE_ROUND, jobs=1)
    assert found.findings == ()
    assert found.verdict == "unexplained"
    assert found.p_value <= 0.01
    assert found.unnamed.acts_on.startswith("most like ")
    assert found.unnamed.acts_on.endswith("which brings recordings that are left out no nearer")


def test_a_rig_that_lacks_nothing_gets_no_name():
    found = _diagnosed(None)
    assert found.findings == ()
    assert found.verdict == "no_mismatch"


@pytest.mark.parametrize("effect", NOTHING_OR_SOMETHING)
def test_report_recordings_change_nothing_but_the_reported_errors(effect):
    runs, before = _runs(effect), _diagnosed(effect)
    assert bool(before.findings) == bool(effect)
    kept = {r.name for r in before.split.report}
    assert 0 < len(kept) < len(runs)
    rng = np.random.default_rng(0)
    noisy = [
        replace(r, v1=rng.normal(size=r.n), v2=rng.normal(size=r.n), u=rng.normal(size=r.n)) if r.name in kept else r
        for r in runs
    ]
    after = diagnose(noisy, settings=QUICK, jobs=1)
    assert after.after_rms != before.after_rms
    for one, other in ((before.drive, after.drive), (before.base, after.base)):
        assert one.values == other.values
        assert one.intervals == other.intervals
        assert np.array_equal(one.covariance.matrix, other.covariance.matrix)
        assert np.array_equal(one.run_to_run.matrix, other.run_to_run.matrix)
        assert one.recorded == other.recorded
    told = [d.as_json() for d in (before, after)]
    for entry in told:
        entry["seconds"] = 0.0
        entry["fit"]["per_recording"] = [f for f in entry["fit"]["per_recording"] if f["part"] == "estimation"]
        for name in ("before_rms", "after_rms", "floor_rms"):
            entry["fit"][name] = None
        for finding in entry["findings"]:
            finding["heldout_rms_before"] = finding["heldout_rms_after"] = None
    assert told[0] == told[1]


def test_the_diagnosed_drive_can_be_drawn_within_its_intervals():
    found = _diagnosed("ground_spring")
    drawn = np.array([d["ground_spring.kg"] for d in found.drive.draw(np.random.default_rng(0), 500)])
    low, high = found.findings[0].parameters["kg"].ci95
    assert np.quantile(drawn, [0.025, 0.975]) == pytest.approx([low, high], rel=0.05)


@pytest.mark.parametrize("effect", NOTHING_OR_SOMETHING)
def test_the_answer_is_the_same_for_any_number_of_jobs_and_has_schema_2(effect):
    one, two = _diagnosed(effect).as_json(), diagnose(_runs(effect), settings=QUICK, jobs=2).as_json()
    assert one.pop("seconds") > 0.0
    two.pop("seconds")
    assert one == two
    assert one["schema"] == 2
    assert set(one["split"]) == {"estimation", "selection", "report"}


def test_a_level_outside_0_to_1_is_an_error():
    with pytest.raises(ValueError, match="alpha: must lie between 0 and 1; got 2. The default is 0.02"):
        diagnose(data_set()[:1], alpha=2.0)


def test_what_the_rig_description_knows_belongs_to_the_base_model():
    runs = RecordingSet(_runs("ground_spring"), rig=Rig(known=("ground_spring",)))
    found = diagnose(runs, settings=QUICK, jobs=1)
    assert "ground_spring" not in {f.id for f in found.findings}
    assert found.base["ground_spring.kg"] == pytest.approx(0.05, rel=0.05)


def test_what_the_reported_drive_does_not_have_is_no_finding(monkeypatch):
    """A reader would see a name with the size zero. Here the output error has no spring to ground left."""
    monkeypatch.setattr(_Result, "_by_output_error", lambda _, model, __: replace(model, values=_without_ground(model)))
    found = diagnose(_runs("ground_spring"), settings=ONE_ROUND, jobs=1)
    assert found.findings == ()
    assert found.verdict == "unexplained"
    assert found.unnamed.acts_on.endswith("which the simulation that fits best does without")


def _without_ground(model):
    return {k: 0.0 if k.startswith("ground_spring") else v for k, v in model.values.items()}

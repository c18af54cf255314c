"""What a diagnosis says: JSON as its schema demands, sentences with name, place, size and doubt, all in the rig's units."""

import dataclasses
import json
import math
from importlib.resources import files
from types import SimpleNamespace

import jsonschema
import numpy as np
import pytest

from baselines.report import words
from baselines.report.diagnosis import _limits, _tiles
from baselines.report.diagnosis_pictures import shown_recording
from flexdrive_gym.recording import Fault
from flexdrive_gym.units import Units
from identification.mismatch.answer.finding import Curve, Estimate, Finding, Named, Unnamed, percent
from identification.mismatch.answer.homogeneity import Homogeneity
from identification.mismatch.answer.verdict import Interval, Prediction, RecordingFit, in_units
from identification.mismatch.force.maps import Located, Map
from identification.mismatch.selection.detection import DetectionLimit
from identification.quantities import Quantity
from tests.identification.mismatch.lab import diagnosis

SCHEMA = json.loads((files("identification.mismatch") / "diagnosis.schema.json").read_text(encoding="utf-8"))
RIG = Units("m", "mV", per_length=1000.0, per_command=1e-3)
SIZES = {"extra": Estimate(0.1, (0.08, 0.12), "V"), "vs": Estimate(40.0, (30.0, math.inf), "mm/s")}
TIES = (Named("presliding", "cart_1"), Named("quadratic_drag", "cart_1"))
FINDING = Finding("stribeck", "cart_1", SIZES, TIES, "plateaus at ±0.7…1 V and at ±3 V", 0.6, 0.01, 9.0, math.nan)
CURVE = Curve("the velocity of cart 2", "mm/s", np.array([-20.0, 20.0]), np.array([0.1, -0.1]), np.zeros(2))
BEYOND = "In the predicted motion the command reaches 8 V, 2.5 V were recorded."
FULL = diagnosis(
    verdict="partly_explained",
    findings=(FINDING,),
    faults=(Fault("a", "encoder_1", "encoder_dropout", 1.0, 2.0),),
    located=(Located("cart_1", 0.7, "v1 near 0", "a sentence"),),
    unnamed=Unnamed("cart_2", 0.3, "as a function of the velocity of cart 2", ((Named("tilt", "guide"), 0.8),), CURVE),
    predictions=(
        Prediction(
            "critical_gain_x2_simulated",
            Interval(0.25, (0.2, 0.3)),
            Interval(0.22, (0.21, None)),
            "V/mm",
            "0.2 held",
            BEYOND,
        ),
        Prediction("resonance_hz", Interval(2.5, None), Interval(None, None), "Hz"),
    ),
    homogeneity=(Homogeneity("d1", 0.002, {"a": 0.3, "b": 0.4}, "d1 changed between sessions: 0.3 in a, 0.4 in b."),),
    detection_limits=(
        DetectionLimit("tilt", "guide", "F", 0.02, "V", 0.1, {}),
        DetectionLimit("coil_bind", "spring", "kb", math.inf, "V/mm", 0.05, {"d0": (5.0, "mm")}),
    ),
    after_rms=5.0,
    floor_rms=4.0,
)


def test_the_schema_is_one():
    jsonschema.Draft202012Validator.check_schema(SCHEMA)


@pytest.mark.parametrize("found", [diagnosis(), FULL])
def test_json_is_valid_and_holds_no_nan(found):
    content = found.as_json()
    jsonschema.validate(content, SCHEMA)
    assert json.loads(json.dumps(content, allow_nan=False)) == content


def test_the_schema_refuses_what_is_not_in_the_contract():
    content = FULL.as_json()
    for change in ({"verdict": "perhaps"}, {"findings": [{"id": "stribeck"}]}, {"surprise": 1}, {"schema": 1}):
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate({**content, **change}, SCHEMA)


def test_a_statement_says_what_where_how_big_and_how_sure():
    for part in (
        "stribeck at cart 1",
        "extra = 0.1 [0.08, 0.12] V",
        "60%",
        "p = 0.01",
        "cannot tell it from presliding",
    ):
        assert part in FINDING.statement


def test_the_verdict_in_words():
    text = " ".join(words.verdict_sentences(FULL))
    assert "Stribeck effect at cart 1" in text
    assert "from 8 to 5 mm/s" in text
    assert "30% of the remaining squared error has no name" in text
    assert [percent(x) for x in (0.0, 1e-3, 0.3)] == ["0%", "less than 1%", "30%"]
    assert "No left-out physics" in words.verdict_sentences(diagnosis())[0]


def test_predictions_come_with_their_interval_and_why_they_extrapolate():
    by = {p.name: p for p in FULL.predictions}
    assert words.interval(by["critical_gain_x2_simulated"].before) == "0.25 [0.2, 0.3]"
    assert words.interval(by["critical_gain_x2_simulated"].after) == "0.22 [0.21, no limit]"
    assert words.interval(by["resonance_hz"].after) == "–"
    assert words.extrapolation_sentences(FULL) == [f"Extrapolated: critical gain from x2, simulated. {BEYOND}"]


def test_how_small_what_is_not_named_may_be_is_told_in_the_rigs_units():
    tilt, bind = FULL.as_json()["detection_limits"]
    assert (tilt["value"], tilt["unit"], tilt["shape"]) == (0.02, "V", {})
    assert bind["value"] is None
    own = in_units(FULL, RIG).detection_limits
    assert (own[0].value, own[0].usual, own[0].unit) == (pytest.approx(20.0), pytest.approx(100.0), "mV")
    assert own[1].shape == {"d0": (pytest.approx(0.005), "m")}
    # the hardest to see first
    assert _limits(FULL).blocks[1].rows == (
        ("coil bind at spring", "kb", "any within its bounds", "V/mm", "–", "d0 = 5 mm"),
        ("tilt at guide", "F", "0.02", "V", "0.2", "–"),
    )
    assert not _limits(diagnosis()).blocks
    # of what is named already nothing is hidden
    bump = DetectionLimit("position_friction", "cart_2", "amplitude", 0.02, "V", 0.05, {"P": (28.0, "mm")})
    said = _limits(diagnosis(detection_limits=(bump,))).blocks[1].text
    assert "bumps of friction are hidden most" in said
    assert "ground" not in said


def test_what_changed_between_sessions_is_said():
    assert words.homogeneity_sentence(FULL) == "d1 changed; the others are the same within their uncertainty."
    assert words.homogeneity_sentence(diagnosis()).startswith("Not asked")


def fits(**errors):
    """Report recordings by name, with their errors before and after."""
    return tuple(RecordingFit(name, "report", *pair, unit="mm") for name, pair in errors.items())


def test_what_got_worse_is_said_worst_first():
    report = fits(a=(3.2, 13.1), b=(8.0, 7.0), c=(4.0, 4.1), d=(1.0, 1.2))
    worse = dataclasses.replace(FULL, per_recording=(*report, RecordingFit("fitted", "estimation", 1.0, 9.0)))
    assert [f.recording for f in words.worsened(worse)] == ["a", "d"]
    text = " ".join(words.verdict_sentences(worse))
    assert "2 of 4 report recordings got worse: a (3.2 → 13.1 mm) and d (1 → 1.2 mm)." in text
    tile = next(tile for tile in _tiles(worse) if "worse" in tile)
    assert tile["number"] == "3.2 → 13.1"
    assert not words.worse_sentences(FULL)


def test_the_headline_picture_is_the_median_run():
    shown = fits(a=(1.0, 9.0), b=(9.0, 1.0), c=(5.0, 4.0))
    runs = [SimpleNamespace(name=name) for name in "abc"]
    split = SimpleNamespace(report=runs, loops=[], estimation=[])
    run, fit = shown_recording(SimpleNamespace(split=split, per_recording=shown))
    assert (run.name, fit.recording) == ("c", "c")


def test_without_a_name_the_headline_picture_is_that_of_the_median_error():
    """And not of the recording that comes first in the alphabet."""
    shown = tuple(RecordingFit(name, "report", rms, rms) for name, rms in {"a": 4.0, "b": 13.0, "c": 12.0}.items())
    split = SimpleNamespace(report=[SimpleNamespace(name=name) for name in "abc"], loops=[], estimation=[])
    assert shown_recording(SimpleNamespace(split=split, per_recording=shown))[1].recording == "c"


def test_ties_name_the_experiment():
    text = " ".join(words.tie_sentences(FINDING))
    assert "cannot tell Stribeck effect at cart 1 from presliding at cart 1 or quadratic drag at cart 1" in text
    assert "record plateaus at ±0.7…1 V" in text


def test_ratios_outside_their_interval_are_denied():
    held = words.ratio_sentences(diagnosis())
    assert not any("do not hold" in line for line in held)
    ratios = {**diagnosis().ratios, "beta": Quantity(0.3, "", ci95=(0.25, 0.35))}
    denied = words.ratio_sentences(diagnosis(ratios=ratios))
    assert denied[0] == "The handout's ratios do not hold here: β = b2/b1 = 0.3 [0.25, 0.35] (handout 0.1)."


def test_share_of_what_could_be_explained():
    # 64 -> 25 with a floor of 16: 39 of 48
    assert words.within_reach(FULL) == pytest.approx(39 / 48)


def test_every_figure_is_in_the_rigs_units():
    found = in_units(dataclasses.replace(FULL, per_recording=(RecordingFit("a", "report", 8.0, 4.0, 2.0),)), RIG)
    assert str(found.findings[0].parameters["extra"]) == "100 [80, 120] mV"
    assert found.findings[0].unit == found.unit == "m/s"
    assert found.findings[0].report_rms_before == pytest.approx(9e-3)
    assert (found.before_rms, found.after_rms, found.floor_rms) == pytest.approx((8e-3, 5e-3, 4e-3))
    (fit,) = found.per_recording
    assert (fit.before_rms, fit.after_rms, fit.floor_rms, fit.unit) == pytest.approx((8e-3, 4e-3, 2e-3, "m/s"))
    assert found.unnamed.curve.unit == "m/s"
    assert found.unnamed.curve.force == pytest.approx([100.0, -100.0])
    assert found.drive.units == found.base.units == RIG


def test_a_map_says_where_in_the_rigs_units():
    m = Map("cart_1", "v1", np.array([-20.0, 20.0]), np.array([0.05, -0.1]), np.array([0.01, 0.01]), 0.5, 0.07)
    assert m.sentence.endswith("it is largest, -0.1 V, at v1 = 20 mm/s")
    assert m.of_rig(RIG).sentence.endswith("it is largest, -100 mV, at v1 = 0.02 m/s")


def test_a_parameter_at_its_bound_is_not_said_to_be_known_exactly():
    assert str(Estimate(1.0, (1.0, 1.0), "1")) == "1 (no interval)"
    assert str(Estimate(0.036, (0.017, 0.054), "mm/V")) == "0.036 [0.017, 0.054] mm/V"

"""What a diagnosis says: JSON as its schema demands, sentences with name, place, size and doubt."""

import json
import math
from importlib.resources import files

import jsonschema
import pytest

from baselines.report import words
from flexdrive_gym.recording import Fault
from identification.mismatch.verdict import Estimate, Finding, Located, Named, Prediction, Unnamed, statement
from identification.quantities import Quantity
from tests.identification.mismatch.lab import diagnosis

SCHEMA = json.loads((files("identification.mismatch") / "diagnosis.schema.json").read_text(encoding="utf-8"))
SIZES = {"extra": Estimate(0.1, (0.08, 0.12), "V"), "vs": Estimate(40.0, (30.0, math.inf), "mm/s")}
TIES = (Named("presliding", "cart_1"), Named("quadratic_drag", "cart_1"))
FINDING = Finding(
    "stribeck",
    "cart_1",
    SIZES,
    TIES,
    "plateaus at ±0.7…1 V and at ±3 V",
    0.6,
    0.01,
    9.0,
    math.nan,
    "mm/s",
    statement("stribeck", "cart_1", SIZES, 0.6, 0.01, TIES),
)
FULL = diagnosis(
    verdict="partly_explained",
    findings=(FINDING,),
    faults=(Fault("a", "encoder_1", "encoder_dropout", 1.0, 2.0),),
    located=(Located("cart_1", 0.7, "v1 near 0", "a sentence"),),
    unnamed=Unnamed("cart_2", 0.3, "v2, largest", (("tilt", 0.8),)),
    predictions=(Prediction("critical gain from x2, simulated", 0.25, None, "V/mm", "0.2 held"),),
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
    for change in ({"verdict": "perhaps"}, {"findings": [{"id": "stribeck"}]}, {"surprise": 1}):
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate({**content, **change}, SCHEMA)


def test_a_statement_says_what_where_how_big_and_how_sure():
    for part in (
        "stribeck at cart 1",
        "extra = 0.1 [0.08, 0.12] V",
        "60%",
        "probability 0.01",
        "cannot tell it from presliding",
    ):
        assert part in FINDING.statement


def test_the_verdict_in_words():
    text = " ".join(words.verdict_sentences(FULL))
    assert "Stribeck effect at cart 1" in text
    assert "from 8 to 5 mm/s" in text
    assert "30% of the remaining squared error has no name" in text
    assert "No left-out physics" in words.verdict_sentences(diagnosis())[0]


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

"""The figures of the concealed trial are those of the outcomes that lie beside the page."""

import hashlib
import json
import runpy
from collections import Counter

from baselines.blind_study.judge import judge
from baselines.blind_study.payoff import Payoff
from baselines.blind_study.plan import plan
from baselines.blind_study.study import outcomes, settings
from baselines.blind_study.summary import headline, summarise
from tests.docs.pages import ROOT, read

# the one of the present engine
LATEST = ROOT / "docs/trial/seed_9"


def found_in(folder):
    asked = settings(folder)
    return outcomes(folder, plan(asked["trials"], asked["seed"]))


def test_every_figure_is_the_study_s():
    page, readme = read("docs/trial.md"), read("README.md")
    rows = headline(summarise([judge(outcome) for outcome in found_in(LATEST)]))
    for what, value, aim in rows:
        row = f"| {what} | {value} | {aim} |"
        assert row in page
        if f"| {what} |" in readme:
            assert row in readme
    found = {what: value.split(" (")[0] for what, value, _ in rows}
    assert rows[0][1] in readme
    named, _, all_ = found["all trials with a name of nothing concealed"].split()[:3]
    assert f"Of {all_} data sets {named} have a name of nothing concealed" in readme
    broken, _, all_ = found["broken encoders found"].split()[:3]
    assert broken == all_
    assert f"all {broken} broken encoders are found" in readme
    inside = found["m1 … d2 of nulls within their 95 % intervals"].split(" = ")[1].rstrip("%")
    assert f"lie within their 95 % intervals in {inside} %" in readme
    assert f"flexdrive blind --report -o docs/trial/{LATEST.name}" in readme


def test_the_latest_row_is_that_of_its_outcomes():
    figures = runpy.run_path(str(ROOT / "docs/studies.py"))
    row = next(r for r in figures["rows"]() if r["study"] == LATEST.name)
    assert row | figures["row"](LATEST) == row


def test_studies_are_compared_by_their_figures():
    page = read("docs/trial.md").splitlines()
    studies = runpy.run_path(str(ROOT / "docs/studies.py"))["rows"]()
    assert [row["study"] for row in studies if row["seed"].isdecimal()] == [
        "seed_1", "begun_2", "seed_3", "begun_5", "seed_6", "begun_7", "begun_8", "seed_9",
    ]  # fmt: skip
    for row in (r for r in studies if r["seed"].isdecimal()):
        line = next(text for text in page if text.startswith(f"| `{row['study']}`"))
        nulls, pairs, unnamed, unnoticed = (
            row[what].split(" = ")[0]
            for what in (
                "nulls with a name",
                "pairs, both named",
                "effects outside the catalogue reported as unnamed",
                "effects outside the catalogue not noticed",
            )
        )
        singles = row["single effects from half size on, named exactly or in a tie"].split(" (")[0]
        said = f"| {singles} | {nulls} | {pairs} | {unnamed.split()[0]} and {unnoticed} |"
        assert said in line, row["study"]
        assert row["trials"] == "200" or f"stopped after {row['trials']} trials" in line
        seconds = float(line.rstrip("| ").rsplit("| ", maxsplit=1)[-1])
        assert abs(seconds - float(row["seconds per diagnosis on one core, median"])) < 0.5, row["study"]


def test_where_the_last_study_fell_short():
    found = found_in(LATEST)
    judged = [judge(outcome) for outcome in found]
    assert len(found) == 200
    assert [outcome["trial"]["number"] for outcome in found if outcome["failed"] is not None] == []
    missed = [
        (t.number, t.kind, c.id, c.size) for t in judged for c in t.concealed if c.named == "missed" and c.size >= 0.5
    ]
    assert Counter(kind for _, kind, _, _ in missed) == {"pair": 10, "effect": 8, "fault": 1}
    assert [(n, size) for n, _, id_, size in missed if id_ == "position_friction"] == [
        (18, 0.5),
        (102, 2.0),
        (109, 0.5),
        (185, 2.0),
        (192, 0.5),
    ]
    along = [c.named for t in judged for c in t.concealed if c.id == "position_friction" and c.size >= 0.5]
    assert (len(along), along.count("missed")) == (6, 5)
    assert [(n, kind) for n, kind, id_, _ in missed if id_ == "extra_mode"] == [
        (14, "pair"),
        (104, "pair"),
        (133, "pair"),
    ]
    assert Counter(size for _, kind, _, size in missed if kind == "effect") == {0.5: 5, 1.0: 1, 2.0: 2}
    assert {(n, id_) for n, kind, id_, size in missed if kind == "effect" and size >= 1.0} == {
        (93, "quadratic_drag"),
        (102, "position_friction"),
        (184, "breakaway"),
    }
    assert [(n, id_) for n, kind, id_, _ in missed if kind == "fault"] == [(20, "motor_gear_backlash")]
    assert judged[20].unnamed
    unnamed = {n: found[n]["answer"]["diagnosis"]["unnamed"] for n in (184, 185)}
    assert unnamed[184]["where"] == "cart_1"
    assert unnamed[184]["acts_on"].startswith("friction against")
    assert unnamed[185]["nearest"][0]["id"] == "position_friction"
    assert "recordings kept away show it" in unnamed[185]["acts_on"]
    false = [t for t in judged if t.false_names]
    beside = [t for t in false if t.kind != "outside" and any(c.named != "missed" for c in t.concealed)]
    assert (len(false), len(beside)) == (13, 5)
    assert [t.number for t in judged if t.false_faults] == [66]
    strangers = [
        (outcome["truth"]["effects"][0]["id"], finding["id"])
        for outcome, trial in zip(found, judged, strict=True)
        if trial.kind == "outside"
        for finding in outcome["answer"]["diagnosis"]["findings"]
    ]
    assert sorted(strangers) == [
        ("command_friction", "spring_hysteresis"),
        ("cubic_brake_with_resonance", "extra_mode"),
        ("magnet_detent", "cogging"),
        ("one_sided_stop", "ground_spring"),
        ("slew_limit", "amplifier_lag"),
        ("slipping_belt", "load_friction"),
        ("slipping_belt", "saturation"),
    ]
    unnoticed = [t.outside for t in judged if t.kind == "outside" and not t.false_names and not t.unnamed]
    assert (len(unnoticed), unnoticed.count("one_sided_stop")) == (5, 2)


def test_one_rig_of_the_last_study_is_unstable_with_every_drive():
    paid = {o["trial"]["number"]: Payoff.from_json(o["payoff"]) for o in found_in(LATEST) if o["payoff"]}
    unstable = {n: {r.drive for r in rig.outcomes if not r.stable} for n, rig in paid.items()}
    assert len(paid) == 24
    assert {n: drives for n, drives in unstable.items() if drives} == {195: {"tied", "free", "diagnosed"}}
    rig = next(o for o in found_in(LATEST) if o["trial"]["number"] == 195)
    assert [c.named for c in judge(rig).concealed] == ["exact", "exact"]
    assert any("beyond 13 mm" in n and "go to 12 mm" in n for n in rig["answer"]["diagnosis"]["notes"])


def test_truths_are_what_was_sealed():
    """The hash was printed before the diagnosis began; a truth is written as one indented JSON object."""
    for outcome in found_in(LATEST):
        text = json.dumps(outcome["truth"], indent=1, sort_keys=True) + "\n"
        assert hashlib.sha256(text.encode()).hexdigest() == outcome["sha256"]

"""Equal recordings, random effects, who stands out and what changed: against what statistics says by hand."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import t as student

from baselines.term.changes import changes
from baselines.term.copies import equal_recordings, fingerprint
from baselines.term.evidence import RunEvidence
from baselines.term.outliers import apart, failing_encoders, tau_squared
from baselines.term.random_effects import Rig, random_effects
from flexdrive_gym import Drive
from tests.drive.drives import RIG
from tests.identification.lab import COUNTS, QUANTUM, T, run


def recorded(seed, kind="square"):
    rig = Drive({**RIG, **COUNTS})
    made = run(rig, kind, 2.0, 0.5 if kind == "square" else 3.0, t=T, force=0.05, seed=seed)
    return replace(made, quantum=(QUANTUM, QUANTUM))


def part(recording, first, last, sign=1.0):
    channels = {c: sign * getattr(recording, c)[first:last] for c in ("v1", "v2")}
    return replace(recording, t=recording.t[first:last], u=recording.u[first:last], **channels)


def test_a_copy_is_found_cut_turned_and_renamed_and_a_replicate_is_none():
    prints = {
        "A": {"square": fingerprint(recorded(1))},
        "B": {"ours": fingerprint(part(recorded(1), 700, 3300, sign=-1.0)), "own": fingerprint(recorded(2, "sine"))},
        "C": {"replicate": fingerprint(recorded(3))},
    }
    (found,) = equal_recordings(prints)
    assert (found.first, found.second) == ("A", "B")
    ((one, other, share),) = found.pairs
    assert (one, other) == ("square", "ours")
    assert share == pytest.approx(1.0)


def test_half_of_a_recording_is_told_as_half():
    other = recorded(2)
    mixed = replace(
        other, v1=np.r_[recorded(1).v1[:2000], other.v1[2000:]], v2=np.r_[recorded(1).v2[:2000], other.v2[2000:]]
    )
    (found,) = equal_recordings({"A": {"a": fingerprint(recorded(1))}, "B": {"b": fingerprint(mixed)}})
    assert found.pairs[0][2] == pytest.approx(0.5, abs=0.15)


def balanced(rng, sd, rigs=6, sessions=3, runs=8, error=0.05):
    """Values of one parameter in a balanced nested design."""
    a, b, c = sd
    return (
        np.log(0.4)
        + a * rng.standard_normal((rigs, 1, 1))
        + b * rng.standard_normal((rigs, sessions, 1))
        + c * rng.standard_normal((rigs, sessions, runs))
        + error * rng.standard_normal((rigs, sessions, runs))
    )


def as_rigs(y, error=0.05):
    A = np.array([[1.0 / error**2]])
    return [
        Rig(f"rig {i}", tuple(tuple(RunEvidence("", "", A, A @ [x]) for x in session) for session in rig))
        for i, rig in enumerate(y)
    ]


def test_restricted_likelihood_gives_the_mean_squares_of_a_balanced_design():
    error = 0.05
    y = balanced(np.random.default_rng(3), (0.3, 0.2, 0.1), error=error)
    rigs, sessions, runs = y.shape
    within = np.sum((y - y.mean(axis=2, keepdims=True)) ** 2) / (rigs * sessions * (runs - 1))
    of_sessions = runs * np.sum((y.mean(axis=2) - y.mean(axis=(1, 2))[:, None]) ** 2) / (rigs * (sessions - 1))
    of_rigs = runs * sessions * np.sum((y.mean(axis=(1, 2)) - y.mean()) ** 2) / (rigs - 1)
    by_hand = {
        "run": within - error**2,
        "session": (of_sessions - within) / runs,
        "rig": (of_rigs - of_sessions) / (runs * sessions),
    }
    assert min(by_hand.values()) > 0.0
    found = {s.level: s for s in random_effects(["d1"], as_rigs(y, error))}
    for level, variance in by_hand.items():
        assert found[level].value == pytest.approx(np.sqrt(variance), rel=1e-3)
        assert found[level].ci95[0] < np.sqrt(variance) < found[level].ci95[1]


def test_what_does_not_differ_has_an_interval_from_zero():
    found = {s.level: s for s in random_effects(["d1"], as_rigs(balanced(np.random.default_rng(0), (0.3, 0.0, 0.1))))}
    assert found["session"].ci95[0] == 0.0
    assert found["rig"].ci95[0] > 0.05


def test_parameters_that_trade_off_in_every_run_are_told_apart():
    rng = np.random.default_rng(5)
    rigs = []
    for i in range(12):
        own = np.array([0.3 * rng.standard_normal(), 0.0])
        runs = []
        for _ in range(10):
            # a run knows one direction well and the other badly, and which one changes from run to run
            angle = rng.uniform(0.0, np.pi)
            R = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
            A = R @ np.diag([1.0 / 0.02**2, 1.0 / 2.0**2]) @ R.T
            z = own + np.linalg.cholesky(np.linalg.inv(A)) @ rng.standard_normal(2)
            runs.append(RunEvidence("", "", A, A @ z))
        rigs.append(Rig(f"{i}", (tuple(runs),)))
    found = {(s.parameter, s.level): s for s in random_effects(["d", "b"], rigs)}
    assert found["d", "rig"].ci95[0] < 0.3 < found["d", "rig"].ci95[1]
    assert found["b", "rig"].value < 0.02
    assert ("d", "session") not in found  # one in each rig


def term(values, log_se=0.03):
    return {f"group {i}": {"d1": {"value": v, "log_se": log_se}} for i, v in enumerate(values)}


def test_two_rigs_that_need_service_do_not_hide_each_other():
    usual = 0.4 * np.exp(0.05 * np.random.default_rng(1).standard_normal(10))
    found = apart(term([*usual, 0.72, 0.76]))
    assert {a.group for a in found} == {"group 10", "group 11"}
    for a in found:
        assert a.ci95[0] < a.ratio < a.ci95[1]
        assert a.ratio == pytest.approx(0.74 / 0.4, rel=0.15)


def test_of_terms_without_an_outlier_at_most_a_twentieth_has_one():
    rng = np.random.default_rng(2)
    hits = sum(bool(apart(term(0.4 * np.exp(0.08 * rng.standard_normal(10))))) for _ in range(40))
    assert hits <= 6  # 5 % of 40, and what chance adds in 99 % of tries


def test_four_rigs_are_too_few_to_tell():
    assert apart(term([0.4, 0.4, 0.4, 4.0])) == ()


def test_the_variance_between_rigs_makes_cochrans_q_its_expectation():
    y, s = np.array([0.1, 0.4, -0.2, 0.3, 0.0]), np.array([0.05, 0.1, 0.08, 0.05, 0.2])
    w = 1.0 / (s**2 + tau_squared(y, s))
    assert np.sum(w * (y - np.average(y, weights=w)) ** 2) == pytest.approx(4.0)
    assert tau_squared(np.zeros(5), s) == 0.0


def test_an_encoder_fails_where_the_others_do_not():
    usual = {f"g{i}": {"encoder_1": (0, 20), "encoder_2": (1, 20)} for i in range(6)}
    ((group, where, bad, n, p),) = failing_encoders({**usual, "bad": {"encoder_1": (8, 20), "encoder_2": (1, 20)}})
    assert (group, where, bad, n) == ("bad", "encoder_1", 8, 20)
    assert p < 1e-4


def estimate(value, log_se=0.04, degrees=9.0):
    return {"value": value, "log_se": log_se, "degrees": degrees, "unit": "V"}


def test_a_change_is_the_ratio_with_the_errors_of_both_terms():
    terms = {"winter 2022": {"rig 3": {"d1": estimate(0.36)}}, "fall 2025": {"rig 3": {"d1": estimate(0.504)}}}
    (found,) = changes(terms)
    half = student.ppf(0.975, 18.0) * 0.04 * np.sqrt(2.0)
    assert found.ci95 == pytest.approx((1.4 * np.exp(-half), 1.4 * np.exp(half)))
    assert found.sentence() == "since winter 2022 d1 of rig 3 rose by 40 % [24, 58]"


def test_chance_among_many_comparisons_is_no_change():
    old = {f"rig {i}": {"d1": estimate(0.36)} for i in range(20)}
    new = {name: {"d1": estimate(0.36 * (1.15 if name == "rig 7" else 1.0))} for name in old}
    found = {c.rig: c for c in changes({"a": old, "b": new})}
    assert found["rig 7"].ci95[0] > 1.0
    assert not found["rig 7"].significant
    assert "did not change significantly after correction for multiple comparisons" in found["rig 7"].sentence()
    assert found["all rigs"].ratio == pytest.approx(1.15 ** (1 / 20), rel=1e-3)

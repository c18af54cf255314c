"""Leave-one-recording-out by normal equations is what leaving out and fitting again is."""

import numpy as np
import pytest

from identification.mismatch.fitting.score import (
    Normal,
    averaged,
    bounded,
    gains,
    leave_one_out_amplitude,
    leave_one_out_variance,
    shared,
    studentised,
)


def _linear_problem(rng, recordings=5, rows=40, columns=3):
    J = [rng.normal(size=(rows, columns)) for _ in range(recordings)]
    e = [rng.normal(size=rows) for _ in range(recordings)]
    return J, e


def _normal(rows, signs=None):
    return Normal.of(np.array([y.T @ y for y in rows]), signs)


def test_square_left_out_is_that_of_a_fit_to_the_others():
    J, e = _linear_problem(np.random.default_rng(0))
    found = _normal([np.column_stack([j, x]) for j, x in zip(J, e, strict=True)]).left_out(1e-10)
    for r in range(len(J)):
        others = [i for i in range(len(J)) if i != r]
        step = np.linalg.lstsq(np.vstack([J[i] for i in others]), -np.concatenate([e[i] for i in others]), rcond=None)[
            0
        ]
        assert np.isclose(found[r], np.sum((e[r] + J[r] @ step) ** 2), rtol=1e-6)


def test_a_column_without_information_gains_less_than_nothing_on_average():
    rng = np.random.default_rng(1)
    total = []
    for _ in range(200):
        J, e = _linear_problem(rng, columns=1)
        small = [x[:, None] for x in e]
        large = [np.column_stack([j, x]) for j, x in zip(J, e, strict=True)]
        total.append(gains(_normal(small), _normal(large), 1e-10).sum())
    # one parameter costs its variance in prediction, half a unit
    assert -0.9 < np.mean(total) < -0.2


def test_a_sign_asked_for_is_kept():
    rng = np.random.default_rng(2)
    x = rng.normal(size=(60, 2))
    y = x @ np.array([1.0, -2.0])
    rows = [np.column_stack([x, -y])]
    free = _normal(rows).solve()
    signed = _normal(rows, np.array([0.0, 1.0])).solve()
    assert np.allclose(free, [1.0, -2.0], atol=1e-6)
    assert signed[1] >= 0.0


def test_an_experiment_says_no_more_than_the_others_let_expect():
    assert bounded(np.array([500.0, 3.0, -9.0]), np.array([1.0, 4.0, 2.0])).tolist() == [1.0, 3.0, -2.0]


def test_what_one_experiment_alone_shows_or_denies_is_left_out():
    assert shared(np.array([500.0, 0.0, 0.0, 0.0])) == 0.0
    assert shared(np.array([-230.0, 20.0, 20.0, 20.0, 20.0])) == 60.0
    assert shared(np.array([5.0, 7.0])) == 12.0
    gain = np.random.default_rng(5).normal(size=(20000, 12))
    assert abs(np.mean(shared(gain))) < 0.05


def test_a_mean_that_many_show_is_more_than_one_that_a_single_experiment_shows():
    assert studentised(np.array([1.0, 2.0, 3.0])) > studentised(np.array([6.0, 0.0, 0.0]))


def test_random_amplitudes_gain_what_their_likelihood_says():
    # ten recordings of one pair of amplitudes each, of a variance that the others tell
    rng = np.random.default_rng(3)
    information, variance = 4.0, 25.0
    gradient = rng.normal(size=(10, 2)) * np.sqrt(information + information**2 * variance)
    form = np.sum(gradient**2, axis=1)[:, None, None]
    gain, found = leave_one_out_variance(form, np.full((10, 1), information), np.arange(10))
    expected = 0.5 * form[:, 0, 0] / (information + 1.0 / found[0]) - np.log1p(found[0] * information)
    # of the mean gain 1 - 1/e lies within what is expected: a pair's square is exponentially distributed
    assert gain.sum() < expected.sum()
    assert np.all(gain[:, 0, 0] <= found[0] * information - np.log1p(found[0] * information) + 1e-9)
    assert gain.sum() > 0.3 * expected.sum()
    assert 0.3 * variance < found[0] < 3.0 * variance
    none, _ = leave_one_out_variance(
        np.full((10, 1, 1), 2.0 * information), np.full((10, 1), information), np.arange(10)
    )
    assert none.sum() < 0.0


def test_a_ripple_has_one_amplitude_in_all_recordings():
    """A local force that two recordings pass is no ripple, however large it is there."""
    rng = np.random.default_rng(4)
    information, amplitude = np.full((10, 1), 4.0), 2.0

    def gradient(sizes):
        phase = rng.uniform(0.0, 2.0 * np.pi, 10)
        own = np.column_stack([np.cos(phase), np.sin(phase)]) * (4.0 * np.asarray(sizes))[:, None]
        return np.sum((own + 2.0 * rng.normal(size=(10, 2))) ** 2, axis=1)[:, None, None]

    everywhere, found = leave_one_out_amplitude(gradient(np.full(10, amplitude)), information, np.arange(10))
    twice, _ = leave_one_out_amplitude(
        gradient(np.r_[[amplitude * 5**0.5] * 2, np.zeros(8)]), information, np.arange(10)
    )
    assert found[0] == pytest.approx(amplitude, rel=0.3)
    assert everywhere.sum() > 30.0
    assert shared(twice[:, 0, 0]) < 0.3 * shared(everywhere[:, 0, 0])


def test_the_choice_among_many_costs_what_it_gains_by_chance():
    """Of forty periods the one that stands out loses ln(40); of forty alike none was chosen."""
    one, alike = np.zeros((12, 40, 1)), np.full((12, 40, 1), 5.0)
    one[:, 7] = 5.0
    found, best = averaged(one)
    assert best[0] == 7
    assert found.sum() == pytest.approx(60.0 - np.log(40.0), abs=0.01)
    assert averaged(alike)[0].sum() == pytest.approx(60.0)


def test_the_best_of_many_changes_that_are_not_there_is_no_evidence():
    """Over data sets without any of them a likelihood ratio is one on average (V. Vovk, R. Wang, 2021)."""
    rng = np.random.default_rng(5)
    z = rng.normal(size=(12, 40, 4000))
    # the ratio of a change of one standard error in every experiment that is not there
    found, _ = averaged(0.3 * z - 0.5 * 0.3**2)
    ratio = np.exp(found.sum(axis=0))
    assert ratio.mean() == pytest.approx(1.0, abs=0.2)
    assert np.mean(ratio > 20.0) < 1.0 / 20.0

"""Innovations against the dense normal distribution that they factorise, and against draws of the model."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.stats import multivariate_normal

from identification.mismatch.noise.whiten import STATES, Filter, transitions

VALUES = {"m1": 8e-4, "b1": 0.01, "m2": 5e-4, "b2": 3e-3, "k": 0.09}
# stiff drives, heavy ones, and whatever else a search may ask for
DECADES = {"m1": (-7, -2), "b1": (-4, -1), "m2": (-7, -2), "b2": (-4, -1), "k": (-3, 2)}
H, RHO = 0.005, 2e-6
FORCES = np.array([4e-3, 2e-3]), np.array([0.05, 0.02]), 0.3


def _model():
    A, Q = transitions(VALUES, H, *FORCES)
    start = np.array([RHO, 0.0, RHO, 0.0, *(FORCES[1] ** 2), 0.0, 0.0])
    return A, Q, start


def _covariance(A, Q, start, mode):
    """Covariance of stacked readings (x1, x2) of blocks in their modes, from the states' own recursion."""
    n, P, blocks = len(mode), np.diag(start), []
    for m in mode:
        P = A[m] @ P @ A[m].T + Q[m]
        blocks.append(P)
    C = np.eye(STATES)[[0, 2]]
    found = np.zeros((2 * n, 2 * n))
    for i in range(n):
        across = blocks[i]
        for j in range(i, n):
            block = C @ across @ C.T
            found[2 * i : 2 * i + 2, 2 * j : 2 * j + 2] = block
            found[2 * j : 2 * j + 2, 2 * i : 2 * i + 2] = block.T
            across = across @ A[mode[min(j + 1, n - 1)]].T
    return found + RHO * np.eye(2 * n)


# while a cart rests what pulls at it becomes uncertain again, and no reading shows that
@pytest.mark.parametrize(
    "mode", [[0] * 30, [0] * 60 + [1] * 80 + [0] * 40 + [3] * 120 + [0] * 40], ids=["moving", "resting"]
)
def test_innovations_have_the_likelihood_of_the_dense_normal_distribution(mode):
    A, Q, start = _model()
    n, rng = len(mode), np.random.default_rng(0)
    covariance = _covariance(A, Q, start, mode)
    y = rng.multivariate_normal(np.zeros(2 * n), covariance)
    rows = np.ascontiguousarray(y.reshape(n, 2).T[..., None])
    valid = np.ones((2, n), dtype=bool)
    filter_ = Filter.of(A, Q, np.array(mode, dtype=np.int64), start, np.full(2, RHO), valid)
    logarithm = float(np.log(filter_.variance).sum())
    own = -0.5 * (np.sum(filter_.white(rows) ** 2) + logarithm + 2 * n * np.log(2.0 * np.pi))
    assert own == pytest.approx(
        multivariate_normal(np.zeros(2 * n), covariance, allow_singular=True).logpdf(y), rel=1e-9
    )


def test_the_filter_whitens_a_long_run():
    A, Q, start = _model()
    n, rng = 4000, np.random.default_rng(1)
    z, rows = np.zeros(STATES), np.zeros((2, n, 1))
    root = np.linalg.cholesky(Q[0] + 1e-18 * np.eye(STATES))
    for i in range(n):
        z = A[0] @ z + root @ rng.normal(size=STATES)
        rows[:, i, 0] = z[[0, 2]] + np.sqrt(RHO) * rng.normal(size=2)
    mode, valid = np.zeros(n, dtype=np.int64), np.ones((2, n), dtype=bool)
    white = Filter.of(A, Q, mode, start, np.full(2, RHO), valid).white(rows)
    for w in white[..., 0]:
        assert np.std(w) == pytest.approx(1.0, abs=0.05)
        assert abs(np.corrcoef(w[1:], w[:-1])[0, 1]) < 0.05


def test_lost_samples_leave_an_unknown_offset():
    A, Q, start = _model()
    n = 400
    mode, valid = np.zeros(n, dtype=np.int64), np.ones((2, n), dtype=bool)
    valid[1, 100:120] = False
    step = np.zeros((2, n, 1))
    step[1, 120:] = 25.0
    white = Filter.of(A, Q, mode, start, np.full(2, RHO), valid).white(step)
    # 25 mm lost are no motion
    assert np.max(np.abs(white)) < 3.0


def test_a_cart_at_rest_neither_moves_nor_pulls():
    A, _, _ = _model()
    z = np.array([1.0, 0.0, 0.0, 0.0, 0.1, 0.1, 0.0, 0.0])
    after = A[3] @ z
    assert after[:4] == pytest.approx(z[:4], abs=1e-12)


@pytest.mark.parametrize("step", [0.0, H], ids=["positions", "velocities"])
def test_one_column_is_whitened_as_it_is_among_others(step):
    A, Q, start = _model()
    n, rng = 300, np.random.default_rng(2)
    mode, valid = rng.integers(0, 4, n).repeat(5)[:n], rng.random((2, n)) > 0.1
    rows = rng.normal(size=(2, n, 3))
    own = Filter.of(A, Q, mode, start, np.full(2, RHO), valid, step)
    assert own.white(rows[..., :1])[..., 0] == pytest.approx(own.white(rows)[..., 0], rel=1e-9, abs=1e-9)


def test_transitions_are_the_exponential_and_the_integral():
    """C. F. Van Loan, Computing integrals involving the matrix exponential, 1978: exact where nothing is stiff."""
    h, (A, Q) = 1e-3, transitions(VALUES, 1e-3, *FORCES)
    m1, m2, b1, b2, k = (VALUES[n] for n in ("m1", "m2", "b1", "b2", "k"))
    q, s, tau = FORCES
    F, L = (
        np.zeros((STATES, STATES)),
        np.diag([0.0, (q[0] / m1) ** 2, 0.0, (q[1] / m2) ** 2, *(2.0 * s**2 / tau), 0.0, 0.0]),
    )
    F[0, 1] = F[2, 3] = 1.0
    F[1, :5] = [-k / m1, -b1 / m1, k / m1, 0.0, 1.0 / m1]
    F[3, :6] = [k / m2, 0.0, -k / m2, -b2 / m2, 0.0, 1.0 / m2]
    F[4, 4] = F[5, 5] = -1.0 / tau
    both = expm(np.block([[-F, L], [np.zeros_like(F), F.T]]) * h)
    assert A[0] == pytest.approx(expm(F * h), rel=1e-9, abs=1e-15)
    assert Q[0] == pytest.approx(both[STATES:, STATES:].T @ both[:STATES, STATES:], rel=1e-6, abs=1e-15)


def test_innovations_of_any_drive_have_a_variance():
    rng = np.random.default_rng(0)
    for _ in range(300):
        values = {n: 10.0 ** rng.uniform(*d) for n, d in DECADES.items()}
        rho, h = 10.0 ** rng.uniform(-10, -3), float(rng.choice([0.002, 0.005, 0.01]))
        slow = 10.0 ** rng.uniform(-6, 0, 2)
        A, Q = transitions(values, h, 10.0 ** rng.uniform(-6, 0, 2), slow, 10.0 ** rng.uniform(-2, 1))
        mode = rng.integers(0, 4, 400).repeat(rng.integers(1, 40))[:400].astype(np.int64)
        start = np.array([rho, 0.0, rho, 0.0, *(slow**2), 0.0, 0.0])
        made = Filter.of(A, Q, mode, start, np.full(2, rho), np.ones((2, 400), dtype=bool))
        assert np.min(made.variance) >= 0.99 * rho


def test_a_drive_without_inertia_follows_its_force():
    """A velocity of a decay far below a step is force over viscous friction; the exponential of it must not overflow."""
    h, force = 0.005, 2.0
    A, Q = transitions({"m1": 1e-9, "b1": 0.01}, h, np.array([0.01, 0.01]), np.array([0.1, 0.1]), 0.3)
    assert np.isfinite(A).all()
    assert np.isfinite(Q).all()
    moved = A[0] @ [0.0, 0.0, 0.0, 0.0, force, 0.0, 0.0, 0.0]
    assert moved[0] == pytest.approx(force / 0.01 * h, rel=0.06)

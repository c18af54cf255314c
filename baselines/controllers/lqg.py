r"""LQG with a disturbance estimate, from x2 alone or from both encoders.

The sampled drive is augmented by a disturbance at the command that stays, :math:`d_{k+1} = d_k + w`. A Kalman filter estimates
state and disturbance, a linear quadratic regulator brings the state to the reference's,

.. math:: u = u_r - K (\hat x - x_r) - \hat d,

where :math:`x_r, u_r` are what the model needs to carry cart 2 along the reference: with :math:`x_2 = x_r` the spring must be
deflected by :math:`(m_2 a_r + b_2 v_r)/k`. The observer hears the limited command, so nothing winds up. The filter's and the
regulator's speed are chosen for the largest disturbance rejection with Lab 4's margins in hand. Both Riccati equations are
python-control's.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import product
from typing import Any

import numpy as np

from baselines.controllers._design import Design, Family, best_of, derivative, needs_two_carts, stack
from baselines.loop_analysis.loops import sampled_drive
from flexdrive_gym import Drive, LinearController
from flexdrive_gym.recording import FloatArray

# cost of 1 V against 1 mm of cart 2; noise of the disturbance [V per sample] against 1 V of force noise on each cart
_EFFORTS = np.geomspace(1.0, 1e5, 11)
_WANDERING = np.geomspace(1e-3, 1.0, 8)
_COUNT_NOISE_MM = 0.01


def _reference_model(drive: Drive, sample_time: float, states: int) -> tuple[FloatArray, ...]:
    """Return (A, B, C, D) from xr to the plant's reference state and then to its reference command."""
    import control  # noqa: PLC0415  (costs a second; used here only)

    linear = drive.linear
    filters = control.sample_system(stack(derivative(1), derivative(2)), sample_time, method="tustin")
    A, B = np.asarray(filters.A), np.asarray(filters.B) @ np.ones((2, 1))
    v, a = np.asarray(filters.C)
    dv, da = np.asarray(filters.D) @ np.ones(2)
    mass, damping = linear.m1 + linear.m2, linear.b1 + linear.b2
    rows = {
        "x1": ((linear.b2 * v + linear.m2 * a) / linear.k, 1.0 + (linear.b2 * dv + linear.m2 * da) / linear.k),
        "v1": (v, dv),
        "x2": (0.0 * v, 1.0),
        "v2": (v, dv),
        "u": (mass * a + damping * v, mass * da + damping * dv),
    }
    names = ["x1", "v1", "x2", "v2", *["u"] * (states - 4), "u"]
    C, D = np.array([rows[n][0] for n in names]), np.array([[rows[n][1]] for n in names])
    return A, B, C, D


def lqg(
    drive: Drive, effort: float, wandering: float, sensors: tuple[str, ...], sample_time: float
) -> LinearController:
    """Return the LQG controller for one choice of weights.

    Parameters
    ----------
    drive
        With two carts; stored commands of an input delay are states of the plant.
    effort
        Cost of the command's deviation [mm²/V²].
    wandering
        Standard deviation of the disturbance's change per sample [V].
    sensors
        ``("x2",)`` or ``("x1", "x2")``.
    """
    import control  # noqa: PLC0415

    A, B, both = sampled_drive(drive, sample_time)
    n = len(A)
    rows = [("x1", "x2").index(s) for s in sensors]
    C = both[rows]
    Aa = np.block([[A, B], [np.zeros((1, n)), np.ones((1, 1))]])
    Ba = np.vstack([B, np.zeros((1, 1))])
    Ca = np.hstack([C, np.zeros((len(rows), 1))])

    Q = np.zeros((n, n))
    Q[2, 2] = 1.0
    K, _S, _E = _solved(control.dlqr, A, B, Q, np.array([[effort]]))
    noise = np.zeros((n + 1, 3))
    noise[1, 0], noise[3, 1] = sample_time / drive["m1"], sample_time / drive["m2"]
    noise[n, 2] = 1.0
    QN = np.diag([0.03**2, 0.03**2, wandering**2])
    RN = np.eye(len(rows)) * _COUNT_NOISE_MM**2
    _L, P, _E = _solved(control.dlqe, Aa, noise, Ca, QN, RN)
    M = P @ Ca.T @ np.linalg.inv(Ca @ P @ Ca.T + RN)

    Ar, Br, Cr, Dr = _reference_model(drive, sample_time, n)
    r = len(Ar)
    gains = np.hstack([np.asarray(K), np.ones((1, 1))])
    direct = np.hstack([np.asarray(K), np.ones((1, 1))])
    correct = np.eye(n + 1) - M @ Ca
    pick = np.zeros((len(rows), 3))
    for i, row in enumerate(rows):
        pick[i, 1 + row] = 1.0
    # u = [K 1]·(x_r, u_r) - [K 1]·(x̂, d̂) with the estimate corrected by the present reading
    Cu = np.hstack([-gains @ correct, direct @ Cr])
    Du = -gains @ M @ pick + direct @ Dr @ np.array([[1.0, 0.0, 0.0]])
    drives_observer = Aa @ np.hstack([correct, np.zeros((n + 1, r))])
    Atop = drives_observer + Ba @ Cu
    Btop = Aa @ M @ pick + Ba @ Du
    Abig = np.vstack([Atop, np.hstack([np.zeros((r, n + 1)), Ar])])
    Bbig = np.vstack([Btop, Br @ np.array([[1.0, 0.0, 0.0]])])
    name = "lqg" if len(sensors) == 1 else "lqg_both"
    return LinearController(
        Abig, Bbig, np.vstack([Cu, np.zeros((1, n + 1 + r))]), np.vstack([Du, np.zeros((1, 3))]), sample_time,
        np.concatenate([Ba[:, 0], np.zeros(r)]), name=name,
    )  # fmt: skip


def _solved(solve: Callable[..., Any], *matrices: FloatArray) -> Any:
    """Return the answer of a Riccati equation; roundoff stops one solver where another one has no trouble."""
    try:
        return solve(*matrices)
    except ArithmeticError:
        return solve(*matrices, method="scipy")


def _family(name: str, sensors: tuple[str, ...]) -> Family:
    where = " and ".join(sensors)

    def design(drive: Drive, sample_time: float) -> Design:
        needs_two_carts(drive, name)
        tried: dict[int, tuple[float, float]] = {}

        def candidates() -> Iterator[LinearController]:
            for effort, wandering in product(_EFFORTS, _WANDERING):
                candidate = lqg(drive, float(effort), float(wandering), sensors, sample_time)
                tried[id(candidate)] = (float(effort), float(wandering))
                kept.append(candidate)  # an id stays unique only while its object lives
                yield candidate

        kept: list[LinearController] = []
        best, note = best_of(candidates(), drive)
        effort, wandering = tried[id(best)]
        values = {"cost of u": (effort, "mm²/V²"), "disturbance per sample": (wandering, "V")}
        return Design(
            best, f"LQG with disturbance estimate from {where}", ", ".join(sensors), values, (note,) if note else ()
        )

    return Family(name, f"LQG with disturbance estimate from {where}", design, sensors)


FAMILIES = (_family("lqg", ("x2",)), _family("lqg_both", ("x1", "x2")))

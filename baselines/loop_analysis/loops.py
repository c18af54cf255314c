r"""The sampled linear loop, exactly: zero-order hold, input delay, controller.

Between samples the drive follows :math:`\dot x = F x + G u`; with u held over Ts and an input delay
:math:`\tau = n T_s + \rho` the sampled drive is

.. math::
   x_{k+1} = e^{F T_s} x_k + \Gamma_1 u_{k-n-1} + \Gamma_0 u_{k-n}, \quad
   \Gamma_0 = \int_0^{T_s-\rho} e^{F s} G\,ds, \quad \Gamma_1 = e^{F (T_s - \rho)} \int_0^{\rho} e^{F s} G\,ds

(K. J. Åström, B. Wittenmark, Computer-Controlled Systems, 1997, sec. 3.2). A controller that computes its command from the
reading at the same sample adds no delay of its own. Margins are taken with the loop broken at the command, the one place
where every controller's loop, from x1, x2 or both, is a single signal.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from scipy.linalg import expm

from flexdrive_gym import Drive, LinearController, LinearDrive
from flexdrive_gym.recording import FloatArray

if TYPE_CHECKING:
    import control

ComplexArray = npt.NDArray[np.complex128]


def linear_part(drive: Drive) -> Drive:
    """Return the drive reduced to what linear theory knows: masses, dampers, spring and input delay."""
    kept = ("m1", "m2", "b1", "b2", "k", "C", "input_delay.tau")
    return Drive({n: drive[n] for n in kept if n in drive.values}, name=f"{drive.name}, linear part")


def _held(F: FloatArray, G: FloatArray, time: float) -> tuple[FloatArray, FloatArray]:
    """Return e^(F·time) and the integral of e^(F·s)·G over it."""
    n = len(F)
    both = expm(np.block([[F, G], [np.zeros((1, n + 1))]]) * time)
    return both[:n, :n], both[:n, n:]


@lru_cache(maxsize=64)
def _sampled(linear: LinearDrive, tau: float, sample_time: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return A, B, C of the sampled drive; stored commands are the last states, oldest first."""
    M, damping, K = linear.matrices
    carts = len(M)
    n = 2 * carts
    # states x1, v1, x2, v2
    F, G = np.zeros((n, n)), np.zeros((n, 1))
    F[0::2, 1::2] = np.eye(carts)
    F[1::2, 0::2], F[1::2, 1::2] = -np.linalg.solve(M, K), -np.linalg.solve(M, damping)
    G[1, 0] = 1.0 / linear.m1
    # a delay that is whole up to round-off is whole
    whole = int(tau / sample_time + 1e-9)
    rest = max(tau - whole * sample_time, 0.0)
    phi_0, newer = _held(F, G, sample_time - rest)
    phi_1, late = _held(F, G, rest)
    stored = whole + (rest > 0.0)
    A, B, C = np.zeros((n + stored, n + stored)), np.zeros((n + stored, 1)), np.zeros((carts, n + stored))
    A[:n, :n] = phi_1 @ phi_0
    for i in range(stored - 1):
        A[n + i, n + i + 1] = 1.0
    if stored:
        B[-1, 0] = 1.0
    if rest > 0.0:
        A[:n, [n]] = phi_0 @ late
    if whole == 0:
        B[:n] = newer
    else:
        A[:n, [n + stored - whole]] += newer
    C[range(carts), range(0, n, 2)] = 1.0
    return A, B, C


def sampled_drive(drive: Drive, sample_time: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return A, B, C of the sampled linear drive with its input delay: input u [V], outputs x1, x2 [mm] (x1 alone if rigid).

    Parameters
    ----------
    drive
        Its linear part and ``input_delay.tau`` count.
    sample_time
        Control period [s].

    Returns
    -------
    A, B, C : ndarray, shapes (n, n), (n, 1), (carts, n)
        States x1, v1, x2, v2, then the commands under way, oldest first.
    """
    A, B, C = _sampled(drive.linear, drive["input_delay.tau"], sample_time)
    return A.copy(), B.copy(), C.copy()


def closed_loop_matrices(drive: Drive, controller: LinearController) -> tuple[FloatArray, ...]:
    """Return A, B, C, D of the closed loop: inputs xr [mm] and a disturbance d at the command [V], outputs x1, x2 [mm], u [V]."""
    Ap, Bp, Cp = sampled_drive(drive, controller.sample_time)
    carts, m = drive.carts, controller.order
    Ac, Cc = controller.A, controller.C[:1]
    Br, By = controller.B[:, :1], controller.B[:, 1 : 1 + carts]
    Dr, Dy = controller.D[:1, :1], controller.D[:1, 1 : 1 + carts]
    A = np.vstack([np.hstack([Ap + Bp @ Dy @ Cp, Bp @ Cc]), np.hstack([By @ Cp, Ac])])
    B = np.vstack([np.hstack([Bp @ Dr, Bp]), np.hstack([Br, np.zeros((m, 1))])])
    C = np.vstack([np.hstack([Cp, np.zeros((carts, m))]), np.hstack([Dy @ Cp, Cc])])
    D = np.vstack([np.zeros((carts, 2)), np.hstack([Dr, np.zeros((1, 1))])])
    return A, B, C, D


def closed_loop(drive: Drive, controller: LinearController) -> control.StateSpace:
    """Return :func:`closed_loop_matrices` as a python-control object."""
    import control  # noqa: PLC0415  (costs a second; used here only)

    names = [*["x1", "x2"][: drive.carts], "u"]
    return control.ss(
        *closed_loop_matrices(drive, controller), controller.sample_time, inputs=["xr", "d"], outputs=names
    )  # fmt: skip


def response(
    A: FloatArray, B: FloatArray, C: FloatArray, D: FloatArray, omega: npt.ArrayLike, sample_time: float
) -> ComplexArray:
    """Return C·(z - A)⁻¹·B + D at z = e^(jωTs), ndarray, shape (n, outputs, inputs).

    All frequencies in one call: python-control visits them one by one, which is most of a search's time.
    """
    z = np.exp(1j * np.asarray(omega, dtype=np.float64) * sample_time)
    if not len(A):
        return np.broadcast_to(D.astype(np.complex128), (len(z), *D.shape)).copy()
    inner = z[:, None, None] * np.eye(len(A)) - A
    return np.asarray(C @ np.linalg.solve(inner, np.broadcast_to(B.astype(np.complex128), (len(z), *B.shape))) + D)


def loop_response(drive: Drive, controller: LinearController, omega: npt.ArrayLike) -> ComplexArray:
    """Return L(e^(jωTs)), ndarray, shape (n,)."""
    A, B, C = sampled_drive(drive, controller.sample_time)
    plant = response(A, B, C, np.zeros((drive.carts, 1)), omega, controller.sample_time)
    c = controller
    law = response(c.A, c.B, c.C[:1], c.D[:1], omega, c.sample_time)[:, :, 1 : 1 + drive.carts]
    return np.asarray(-(law @ plant)[:, 0, 0])


def closed_loop_response(drive: Drive, controller: LinearController, omega: npt.ArrayLike) -> ComplexArray:
    """Return the closed loop's response, ndarray, shape (n, outputs x1 x2 u, inputs xr d)."""
    A, B, C, D = closed_loop_matrices(drive, controller)
    return response(A, B, C, D, omega, controller.sample_time)


def is_stable(drive: Drive, controller: LinearController) -> bool:
    """Whether every pole of the closed loop lies inside the unit circle."""
    A = closed_loop_matrices(drive, controller)[0]
    return bool(np.max(np.abs(np.linalg.eigvals(A))) < 1.0 - 1e-9)

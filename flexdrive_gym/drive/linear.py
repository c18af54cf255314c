r"""The linear drive: Eqs. (1), (2), (4), (6) and (7) of the handout, from one set of matrices.

With :math:`q = (x_1, x_2)` the drive without Coulomb friction is

.. math::
    M \ddot q + B \dot q + K q = E (u - d_1, -d_2)^T, \quad
    M = \begin{pmatrix} m_1 & \\ & m_2 \end{pmatrix},
    B = \begin{pmatrix} b_1 + C & -C \\ -C & b_2 + C \end{pmatrix},
    K = \begin{pmatrix} k & -k \\ -k & k \end{pmatrix}.

Every transfer function is an element of :math:`(M s^2 + B s + K)^{-1}`: adjugate over determinant, so numerator and
denominator are exact polynomials and no cancellation is left to a numerical routine. A rigid drive has one row.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np

from flexdrive_gym.recording import FloatArray

if TYPE_CHECKING:
    import control
    import numpy.typing as npt

Output = Literal["x1", "x2"]
Input = Literal["u", "d1", "d2"]


@dataclass(frozen=True)
class LinearDrive:
    """The two masses, the dampers and the spring.

    Attributes
    ----------
    m1, m2
        Masses [V s²/mm]; ``m2 = inf`` makes the rigid, one-cart drive of Lab 2.
    b1, b2, C
        Dampers [V s/mm].
    k
        Spring [V/mm].
    """

    m1: float
    m2: float
    b1: float
    b2: float
    k: float
    C: float = 0.0

    @property
    def rigid(self) -> bool:
        """Whether there is only one cart."""
        return not np.isfinite(self.m2)

    @cached_property
    def matrices(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Mass, damping and stiffness matrix, each of shape (carts, carts)."""
        if self.rigid:
            return np.array([[self.m1]]), np.array([[self.b1]]), np.array([[0.0]])
        M = np.diag([self.m1, self.m2])
        B = np.array([[self.b1 + self.C, -self.C], [-self.C, self.b2 + self.C]])
        K = np.array([[self.k, -self.k], [-self.k, self.k]])
        return M, B, K

    def _entry(self, i: int, j: int) -> FloatArray:
        """Coefficients of element (i, j) of M s² + B s + K, highest power first."""
        M, B, K = self.matrices
        return np.array([M[i, j], B[i, j], K[i, j]])

    @cached_property
    def denominator(self) -> FloatArray:
        """Denominator of Eq. (1), monic, highest power first: s⁴ + a1·s³ + a2·s² + a3·s (rigid: s² + p·s)."""
        if self.rigid:
            det = self._entry(0, 0)
        else:
            det = np.polysub(
                np.polymul(self._entry(0, 0), self._entry(1, 1)),
                np.polymul(self._entry(0, 1), self._entry(1, 0)),
            )
        det = det / det[0]
        det[-1] = 0.0  # rigid-body integrator: the determinant of K is zero by construction, not up to round-off
        return np.asarray(det)

    def numerator(self, output: Output = "x2", source: Input = "u") -> FloatArray:
        """Numerator of the transfer function from a source to a position, for the monic denominator.

        Raises
        ------
        ValueError
            For a position or source that the drive does not have.
        """
        row, column = {"x1": 0, "x2": 1}.get(output, -1), {"u": 0, "d1": 0, "d2": 1}.get(source, -1)
        if row < 0 or column < 0 or (self.rigid and (row or column)):
            have = "x1 from u or d1 (one cart)" if self.rigid else "x1 or x2 from u, d1 or d2"
            raise ValueError(f"output, source: the drive has {have}; got {output!r} from {source!r}.")
        sign = 1.0 if source == "u" else -1.0
        if self.rigid:
            return np.array([sign / self.m1])
        adjugate = self._entry(1 - row, 1 - row) if row == column else -self._entry(row, column)
        scaled = sign * adjugate / (self.m1 * self.m2)
        return np.trim_zeros(scaled, "f")

    def transfer_function(
        self, output: Output = "x2", source: Input = "u", *, velocity: bool = False
    ) -> control.TransferFunction:
        """Return G1 or G2 of Eq. (1) (or s·G of Eq. (7)) as a python-control object.

        Parameters
        ----------
        output
            ``x1`` or ``x2``.
        source
            ``u``, or the Coulomb disturbance ``d1`` or ``d2`` (with the minus sign of Eq. (1)).
        velocity
            Velocity instead of position: the integrator is cancelled exactly.

        Returns
        -------
        control.TransferFunction
            From V to mm, or to mm/s.
        """
        import control  # noqa: PLC0415  (costs a second; used here only)

        den = self.denominator[:-1] if velocity else self.denominator
        return control.tf(self.numerator(output, source), den)

    def frequency_response(
        self, omega: npt.ArrayLike, output: Output = "x2", source: Input = "u", *, velocity: bool = True
    ) -> npt.NDArray[np.complex128]:
        """Return G(jω), or jω·G(jω) for ``velocity``.

        Parameters
        ----------
        omega : array_like, shape (n,)
            Frequencies [rad/s].
        """
        s = 1j * np.asarray(omega, dtype=np.float64)
        den = self.denominator[:-1] if velocity else self.denominator
        return np.asarray(np.polyval(self.numerator(output, source), s) / np.polyval(den, s))

    def state_space(self) -> control.StateSpace:
        """Return states (x1, v1, x2, v2), inputs (u, d1, d2), outputs (x1, x2, v1, v2) (rigid: the first of each)."""
        import control  # noqa: PLC0415

        M, B, K = self.matrices
        n = len(M)
        order = [0, 2, 1, 3][: 2 * n] if n == 2 else [0, 1]
        A = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(M, K), -np.linalg.solve(M, B)]])
        force = np.linalg.inv(M)
        inputs = np.column_stack([force[:, 0], *(-force[:, j] for j in range(n))])
        Bu = np.vstack([np.zeros((n, n + 1)), inputs])
        Cy = np.eye(2 * n)
        names = ["x1", "x2", "v1", "v2"] if n == 2 else ["x1", "v1"]
        return control.ss(
            A[np.ix_(order, order)],
            Bu[order],
            Cy[:, order],
            np.zeros((2 * n, n + 1)),
            inputs=["u", "d1", "d2"][: n + 1],
            outputs=names,
            states=[names[i] for i in order],
        )

    @cached_property
    def poles(self) -> npt.NDArray[np.complex128]:
        """Poles of Eq. (1): 0, -p and the complex pair, sorted by magnitude [rad/s]."""
        found = np.append(np.roots(self.denominator[:-1]), 0.0).astype(np.complex128)
        return found[np.argsort(np.abs(found), kind="stable")]

    def zeros(self, output: Output = "x2", source: Input = "u") -> npt.NDArray[np.complex128]:
        """Zeros of a transfer function of Eq. (1) [rad/s]."""
        return np.asarray(np.roots(self.numerator(output, source)), dtype=np.complex128)

    @property
    def oscillatory_poles(self) -> npt.NDArray[np.complex128]:
        """The complex pair, or the two fastest poles where the drive does not oscillate; empty if rigid."""
        if self.rigid:
            return np.zeros(0, dtype=np.complex128)
        pair = self.poles[np.abs(self.poles.imag) > 0.0]
        return pair if len(pair) else self.poles[-2:]

    @property
    def omega_n(self) -> float:
        """Natural frequency ωn of the complex pair [rad/s]; nan for a rigid drive."""
        pair = self.oscillatory_poles
        return float(np.sqrt(np.abs(np.prod(pair)))) if len(pair) else float("nan")

    @property
    def zeta(self) -> float:
        """Damping ratio ζ of the complex pair []; nan for a rigid drive."""
        pair = self.oscillatory_poles
        return float(-np.real(np.sum(pair)) / (2.0 * self.omega_n)) if len(pair) else float("nan")

    @property
    def omega_d(self) -> float:
        """Damped natural frequency ωd [rad/s]; 0 where the drive does not oscillate."""
        return float(self.omega_n * np.sqrt(max(0.0, 1.0 - self.zeta**2)))

    @property
    def p(self) -> float:
        """The real pole's p, exact [1/s] (Eq. (6) is its approximation bT/mT)."""
        others = np.setdiff1d(self.poles, self.oscillatory_poles)
        return float(-np.min(np.real(others)))

    def routh_critical_gain(self, feedback: Output = "x2") -> float:
        """Return the smallest positive P gain at which the loop reaches the stability limit, by Routh's criterion.

        Returns
        -------
        float
            Critical Kp [V/mm]; ``inf`` where every positive gain is stable.

        Notes
        -----
        The closed loop ``s⁴ + a1 s³ + a2 s² + a3 s + Kp·(n2 s² + n1 s + n0)`` is stable iff all coefficients are
        positive and ``a1·c2·c1 - c1² - a1²·c0 > 0`` with ``c2 = a2 + Kp·n2`` and so on: a quadratic in Kp.
        """
        if self.rigid:
            return float("inf")
        _one, a1, a2, a3, _zero = self.denominator
        n2, n1, n0 = np.concatenate([np.zeros(3), self.numerator(feedback)])[-3:]
        c2, c1, c0 = np.array([n2, a2]), np.array([n1, a3]), np.array([n0, 0.0])
        margin = np.polysub(np.polysub(a1 * np.polymul(c2, c1), np.polymul(c1, c1)), a1**2 * np.append([0.0], c0))
        roots = np.roots(np.trim_zeros(margin, "f"))
        real = roots[np.abs(np.imag(roots)) < 1e-9 * np.abs(roots) + 1e-300].real
        # a touching root keeps the sign; the limit is where the quadratic turns negative
        for root in np.sort(real[real > 0.0]):
            if np.polyval(margin, root * (1.0 + 1e-6)) < 0.0:
                return float(root)
        return float("inf")

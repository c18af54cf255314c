r"""A linear controller in discrete time: one object for simulation, environment and margins.

With the readings :math:`y = (x_r, x_1, x_2)` and the state :math:`x`,

.. math::
   u &= C_0 x + D_0 y + F\,\mathrm{sat}\!\left((C_1 x + D_1 y) / v_0\right), \qquad
   \bar u = \mathrm{sat}(u, u_\mathrm{max}), \\
   x^+ &= A x + B y + L (\bar u - u).

The second output is a velocity by which Coulomb friction of level F is compensated, L keeps the state honest while the
command is limited (anti-windup; for an observer, L is the plant's input column). The reference may pass a *shaper* first, a
sum of delayed copies of itself (N. C. Singer, W. P. Seering, ASME J. Dyn. Syst. Meas. Control 112, 1990).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import inf
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from flexdrive_gym.drive.controller import Observation
from flexdrive_gym.drive.loop import Law
from flexdrive_gym.recording import FloatArray
from flexdrive_gym.units import Units

if TYPE_CHECKING:
    import control

INPUT_NAMES = ("xr", "x1", "x2")
# what an input of that name is made of
_INPUTS = {"xr": (1, 0, 0), "x1": (0, 1, 0), "x2": (0, 0, 1), "xr-x1": (1, -1, 0), "xr-x2": (1, 0, -1)}


@dataclass(frozen=True, eq=False)
class LinearController:
    """A linear controller with command limit, anti-windup, friction compensation and reference shaper.

    Parameters
    ----------
    A, B, C, D : ndarray, shapes (n, n), (n, 3), (2, n), (2, 3)
        Inputs xr, x1, x2 [mm]; outputs command [V], velocity for the friction compensation [mm/s].
    sample_time
        Control period [s].
    L : ndarray, shape (n,)
        Effect of what the limit cut off on the state; zeros by default.
    limit
        Largest command [V].
    friction, threshold
        Level of compensated Coulomb friction [V] and the velocity at which it is compensated in full [mm/s].
    shaper
        Pairs (delay in samples, weight) applied to the reference.
    name
        For tables.

    Raises
    ------
    ValueError
        For matrices whose shapes do not fit, a limit or threshold that is not positive, or a delay below zero.
    """

    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: FloatArray
    sample_time: float = 1e-3
    L: FloatArray | None = None
    limit: float = inf
    friction: float = 0.0
    threshold: float = 1.0
    shaper: tuple[tuple[int, float], ...] = ((0, 1.0),)
    name: str = "linear"
    _state: FloatArray = field(init=False, repr=False)
    _past: list[float] = field(init=False, repr=False, default_factory=list)

    def __post_init__(self) -> None:
        n = len(self.A)
        shapes = {"A": (n, n), "B": (n, 3), "C": (2, n), "D": (2, 3), "L": (n,)}
        given = {**{name: getattr(self, name) for name in "ABCD"}, "L": np.zeros(n) if self.L is None else self.L}
        for name, shape in shapes.items():
            value = np.ascontiguousarray(given[name], dtype=np.float64).reshape(
                shape if n == 0 else np.shape(given[name])
            )
            if value.shape != shape or not np.isfinite(value).all():
                raise ValueError(f"{name}: must be finite and of shape {shape} for {n} states; got {value.shape}.")
            object.__setattr__(self, name, value)
        for name in ("sample_time", "limit", "threshold"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name}: must be positive; got {getattr(self, name):g}.")
        if not self.shaper or any(delay < 0 or delay != int(delay) for delay, _weight in self.shaper):
            raise ValueError(f"shaper: must be pairs (whole samples of at least 0, weight); got {self.shaper!r}.")
        object.__setattr__(self, "_state", np.zeros(n))

    @classmethod
    def from_tf(
        cls,
        numerator: npt.ArrayLike,
        denominator: npt.ArrayLike,
        *,
        reads: Literal["x1", "x2"] = "x2",
        domain: Literal["s", "z"] = "s",
        sample_time: float = 1e-3,
        **fields: Any,
    ) -> LinearController:
        """Return a controller from a transfer function, u = C·(xr - x).

        Parameters
        ----------
        numerator, denominator : array_like
            Coefficients of C in falling powers [V/mm].
        reads
            The encoder whose position is x.
        domain
            ``s``: continuous, made discrete by Tustin's rule; ``z``: discrete at the sample time.
        sample_time
            Control period [s].
        **fields
            Others of the class: limit, name, L, …

        Raises
        ------
        ValueError
            For coefficients that are not finite, an improper C, or an unknown domain or encoder.
        """
        from scipy import signal  # noqa: PLC0415  (costs a third of a second; used here only)

        num, den = (np.atleast_1d(np.asarray(c, dtype=np.float64)) for c in (numerator, denominator))
        for name, c in (("numerator", num), ("denominator", den)):
            if c.ndim != 1 or not c.size or not np.isfinite(c).all() or not (name == "numerator" or c.any()):
                raise ValueError(f"{name}: must be finite coefficients in falling powers, not all 0; got {c.tolist()}.")
        num, den = np.trim_zeros(num, "f") if num.any() else np.zeros(1), np.trim_zeros(den, "f")
        if len(num) > len(den):
            raise ValueError(
                f"numerator: must not have a higher degree than the denominator, {len(den) - 1}; got {len(num) - 1}. A pure "
                "derivative needs a filter pole."
            )
        # the library makes a state of a mere gain
        static = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), num / den[0]
        A, B, C, D = signal.tf2ss(num, den) if len(den) > 1 else static
        return cls.from_ss(A, B, C, D, inputs=(f"xr - {reads}",), domain=domain, sample_time=sample_time, **fields)

    @classmethod
    def from_ss(
        cls,
        A: npt.ArrayLike,
        B: npt.ArrayLike,
        C: npt.ArrayLike,
        D: npt.ArrayLike,
        *,
        inputs: Sequence[str] = INPUT_NAMES,
        domain: Literal["s", "z"] = "z",
        sample_time: float = 1e-3,
        **fields: Any,
    ) -> LinearController:
        """Return a controller from state space with inputs by their names, and the command as its only output.

        Parameters
        ----------
        A, B, C, D : array_like, shapes (n, n), (n, m), (1, n), (1, m)
        inputs
            Names of the m inputs: ``xr``, ``x1``, ``x2`` [mm], or an error ``xr - x1``, ``xr - x2``.
        domain
            ``z``: discrete at the sample time; ``s``: continuous, made discrete by Tustin's rule.
        sample_time
            Control period [s].
        **fields
            Others of the class: limit, name, L, …

        Raises
        ------
        ValueError
            For shapes that do not fit, or an unknown input or domain.
        """
        given = tuple(str(name).replace(" ", "") for name in inputs)
        for name in given:
            if name not in _INPUTS:
                raise ValueError(f"inputs: must be among {', '.join(_INPUTS)}; got {name!r}.")
        if domain not in ("s", "z"):
            raise ValueError(f"domain: must be 's' (continuous) or 'z' (discrete); got {domain!r}.")
        n, m = len(np.atleast_1d(np.asarray(A, dtype=np.float64))), len(given)
        matrices = []
        for name, value, shape in (("A", A, (n, n)), ("B", B, (n, m)), ("C", C, (1, n)), ("D", D, (1, m))):
            matrix = np.asarray(value, dtype=np.float64)
            if matrix.size != shape[0] * shape[1]:
                raise ValueError(f"{name}: must be of shape {shape} for {n} states and {m} inputs; got {matrix.shape}.")
            matrices.append(matrix.reshape(shape))
        F, G, H, J = matrices
        if domain == "s" and n:
            from scipy import signal  # noqa: PLC0415

            F, G, H, J, _dt = signal.cont2discrete((F, G, H, J), sample_time, method="bilinear")
        signs = np.array([_INPUTS[name] for name in given])
        # the second output, a velocity for the compensation of friction, is left to other makers
        both = np.vstack([H, np.zeros((1, n))]), np.vstack([J @ signs, np.zeros((1, 3))])
        return cls(F, G @ signs, *both, sample_time, **fields)

    @property
    def tf(self) -> control.TransferFunction:
        """The linear part from xr, x1, x2 [mm] to u [V] as a python-control object with these names; the shaper is left out."""
        import control  # noqa: PLC0415
        from scipy import signal  # noqa: PLC0415

        pairs = [signal.ss2tf(self.A, self.B, self.C[:1], self.D[:1], input=i) for i in range(3)] if self.order else []
        nums = [num[0] for num, _den in pairs] or [np.array([d]) for d in self.D[0]]
        dens = [den for _num, den in pairs] or [np.ones(1)] * 3
        return control.TransferFunction([nums], [dens], self.sample_time, inputs=list(INPUT_NAMES), outputs=["u"])

    @property
    def reads(self) -> str:
        """Names of the encoders that the controller reads: ``x1``, ``x2`` or ``x1, x2``; empty for none."""
        return ", ".join(x for i, x in ((1, "x1"), (2, "x2")) if self.B[:, i].any() or self.D[0, i] != 0.0)

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.A)

    def replace(self, **changes: Any) -> LinearController:
        """Return the controller with other fields and no past."""
        return replace(self, **changes)

    def rescaled(self, units: Units) -> LinearController:
        """Return a controller that speaks a rig's units as one that speaks the engine's."""
        if units.lab:
            return self
        length, command, time = (units.one(unit) for unit in ("mm", "V", "s"))
        assert self.L is not None
        out = np.array([[command], [length / time]])
        return self.replace(
            B=self.B / length,
            C=self.C * out,
            D=self.D * out / length,
            L=self.L / command,
            sample_time=self.sample_time * time,
            limit=self.limit * command,
            friction=self.friction * command,
            threshold=self.threshold * length / time,
        )

    def reset(self) -> None:
        """Forget the past."""
        self._state[:] = 0.0
        self._past.clear()

    def __call__(self, observation: Observation, /) -> float:
        """Return the command [V] and advance the state by one sample."""
        y = np.array([self._shaped(observation.xr), observation.x1, observation.x2])
        u, velocity = (float(v) for v in self.C @ self._state + self.D @ y)
        if self.friction != 0.0:
            u += self.friction * min(max(velocity / self.threshold, -1.0), 1.0)
        allowed = min(max(u, -self.limit), self.limit)
        assert self.L is not None
        self._state[:] = self.A @ self._state + self.B @ y + self.L * (allowed - u)
        return allowed

    def _shaped(self, xr: float) -> float:
        if self.shaper == ((0, 1.0),):
            return xr
        longest = max(delay for delay, _weight in self.shaper)
        if not self._past:
            self._past.extend([xr] * (longest + 1))  # before the run the reference stood still
        self._past.append(xr)
        del self._past[0]
        return sum(weight * self._past[-1 - delay] for delay, weight in self.shaper)

    def shape(self, xr: npt.ArrayLike) -> FloatArray:
        """Return the reference as the controller sees it, ndarray, shape (n,)."""
        given = np.ascontiguousarray(xr, dtype=np.float64)
        total = np.zeros_like(given)
        for delay, weight in self.shaper:
            total += weight * np.concatenate([np.full(min(delay, len(given)), given[0]), given])[: len(given)]
        return total

    def every(self, sample_time: float) -> int | None:
        """Return over how many samples of a rig the command is held; ``None`` where that is no whole number."""
        ratio = self.sample_time / sample_time
        return round(ratio) if ratio > 0.5 and abs(ratio - round(ratio)) < 1e-6 * ratio else None

    def shape_held(self, xr: npt.ArrayLike, every: int) -> FloatArray:
        """Return :meth:`shape` at a rig's samples, of which the controller takes every so many, ndarray, shape (n,)."""
        given = np.asarray(xr, dtype=np.float64)
        return np.repeat(self.shape(given[::every]), every)[: len(given)]

    def law(self, every: int = 1) -> Law:
        """Return the controller as the compiled loop reads it, for a rig whose samples it takes every so many."""
        assert self.L is not None
        constants = np.array([self.limit, self.friction, self.threshold])
        entries = np.concatenate([constants, *(m.ravel() for m in (self.A, self.B, self.C, self.D)), self.L])
        return Law(entries, self.order, every)

    def state_space(self) -> control.StateSpace:
        """Return the linear part from (xr, x1, x2) to u as a python-control object; the shaper is left out."""
        import control  # noqa: PLC0415  (costs a second; used here only)

        return control.ss(
            self.A, self.B, self.C[:1], self.D[:1], self.sample_time, inputs=list(INPUT_NAMES), outputs=["u"]
        )

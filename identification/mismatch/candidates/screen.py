r"""The screen by equation error: linear, global, and in milliseconds.

In the weak form (:mod:`identification.mismatch.force.smooth`) the equations of motion divided by the masses are

.. math::
   a_1 &= \tfrac{1}{m_1} u - \tfrac{b_1}{m_1} v_1 - \tfrac{d_1}{m_1} s_1 - \tfrac{k}{m_1} (\delta + \delta_{rg})
          + \tfrac{\theta}{m_1} F_1, \\
   a_2 &= -\tfrac{b_2}{m_2} v_2 - \tfrac{d_2}{m_2} s_2 + \tfrac{k}{m_2} (\delta + \delta_{rg}) + \tfrac{\theta}{m_2} F_2 .

The target is the acceleration: with the command as target every function of the command explains. Each recording r, and each of
its segments g after a fault, starts with an unknown deflection :math:`\delta_{rg}`, the same in both equations; it is eliminated
by projection, which is the Schur complement of the normal equations. A candidate's columns :math:`F_1, F_2` come from the drive's
own step. Every recording is predicted by the others, weighted by its own noise level.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from flexdrive_gym.drive.parameters import parameter
from flexdrive_gym.recording import FloatArray, Recording
from identification.mismatch.candidates.catalogue import Candidate
from identification.mismatch.fitting.score import Normal, gains
from identification.mismatch.force.smooth import FRICTION_EFFECTS, Motion, force_of, led, motion
from identification.mismatch.settings import Settings

Values = Mapping[str, float]


@dataclass(frozen=True, eq=False)
class Proposal:
    """A candidate as the equation error sees it.

    Attributes
    ----------
    candidate
        What is proposed.
    gain
        Of the predictive log-likelihood over all recordings.
    r2_before, r2
        Share of the accelerations' variance that is predicted without and with it.
    start
        Start values of all parameters.
    """

    candidate: Candidate
    gain: float
    r2_before: float
    r2: float
    start: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class _Rows:
    """Base columns, target and projector of one recording."""

    base: FloatArray
    target: FloatArray
    offsets: FloatArray
    use: FloatArray
    carts: int

    def projected(self, columns: FloatArray, weight: FloatArray) -> FloatArray:
        """Weight columns, shape (2K, m), and take the offsets of the deflection out."""
        y = np.asarray(columns[self.use] * weight[:, None])
        if self.offsets.shape[1] == 0:
            return np.asarray(y)
        Q, R = np.linalg.qr(self.offsets[self.use] * weight[:, None])
        Q = Q[:, np.abs(np.diag(R)) > 1e-9]
        return np.asarray(y - Q @ (Q.T @ y))


class TooShortError(ValueError):
    """No recording holds enough windows for the equation error."""


class Screen:
    """Equation error of several recordings.

    Parameters
    ----------
    recordings
        Of one drive.
    settings
        Constants.
    pool
        Leads several effects along the motion at once.
    present
        Effects that the drive has already, with their values.
    window_s
        Length of the test functions [s].
    resting
        Whether rows at rest and near reversals are kept, for effects that act there.
    """

    def __init__(
        self,
        recordings: Sequence[Recording],
        settings: Settings,
        pool: Executor,
        present: Values | None = None,
        window_s: float | None = None,
        *,
        resting: bool = False,
    ) -> None:
        self.settings, self.resting, self.pool = settings, resting, pool
        self.present = dict(present or {})
        window_s = window_s or settings.window_s
        self.motions = [motion(r, settings, window_s) for r in recordings]
        self.carts = len(self.motions[0].x)
        self.motions = [m for m in self.motions if len(m.windows) > 8]
        if not self.motions:
            raise TooShortError
        self.ratio = 2.0
        self.values: dict[str, float] = {}
        self._base()

    def _base(self) -> None:
        ratio = self.ratio if self.carts == 2 else 1.0
        own: list[FloatArray | None] = [None] * len(self.motions)
        for turn in range(4):
            self.rows = [_rows(m, ratio, shared=turn > 0, resting=self.resting) for m in self.motions]
            self._present_columns(ratio)
            self.weights = self._weights(own)
            normal = self._normal([])
            theta = normal.solve()
            own = self._own(theta)
            c = dict(zip(self._names(), theta, strict=True))
            if self.carts == 2 and c["-k/m1"] > 0.0 and c["k/m2"] > 0.0:
                ratio = float(np.clip(c["k/m2"] / c["-k/m1"], 0.05, 50.0))
        self.ratio = ratio
        self.coefficients = c
        self.values = _physical(c)
        self.base = self._normal([])
        if not np.any(self.base.square):
            raise TooShortError
        self.r2_before = self._r2(self.base)

    def _present_columns(self, ratio: float) -> None:
        """Add the effects that the drive has already as columns of the base."""
        self._extra: list[list[FloatArray]] = [[] for _ in self.motions]
        if not self.present:
            return
        values = self._rough()
        for r, (m, row) in enumerate(zip(self.motions, self.rows, strict=True)):
            self._extra[r] = [_column(force_of(values, self.present, m, self._every(m)), row, ratio)]

    def _every(self, m: Motion) -> int:
        return max(1, round(self.settings.along_s / m.recording.sample_time))

    def _names(self) -> list[str]:
        own = ["1/m1", "-b1/m1", "-d1/m1"]
        own += ["-k/m1", "-b2/m2", "-d2/m2", "k/m2"] if self.carts == 2 else []
        return own + ["present"] * len(self._extra[0])

    def _signs(self) -> list[float]:
        # a viscous coefficient may come out negative where another effect is missing; masses, springs and friction do not
        own = [1.0, 0.0, -1.0] + ([-1.0, 0.0, -1.0, 1.0] if self.carts == 2 else [])
        return own + [0.0] * len(self._extra[0])

    def _weights(self, own: Sequence[FloatArray | None]) -> list[FloatArray]:
        """Return the weight of every used row: its recording's and equation's own noise level."""
        found = []
        for row, residual in zip(self.rows, own, strict=True):
            eq = np.repeat(np.arange(row.carts), len(row.target) // row.carts)[row.use]
            y = row.target[row.use]
            weight = np.ones(len(y))
            for e in range(row.carts):
                part = eq == e
                if not part.any():
                    continue
                expected = self.settings.model_error * float(np.mean(y[part] ** 2))
                mine = expected if residual is None else float(np.mean(residual[part] ** 2))
                share = self.settings.own_share
                weight[part] = 1.0 / np.sqrt(max(share * mine + (1.0 - share) * expected, 1e-12))
            found.append(weight)
        return found

    def _own(self, theta: FloatArray) -> list[FloatArray | None]:
        found: list[FloatArray | None] = []
        for r, (row, weight) in enumerate(zip(self.rows, self.weights, strict=True)):
            both = row.projected(np.column_stack([row.base, *self._extra[r], row.target]), weight)
            found.append((both[:, -1] - both[:, :-1] @ theta) / weight)
        return found

    def _normal(self, columns: Sequence[Sequence[FloatArray]], signs: Sequence[float] = ()) -> Normal:
        """Return the normal equations of base and further columns, recording by recording."""
        parts = []
        for r, (row, weight) in enumerate(zip(self.rows, self.weights, strict=True)):
            more = [c[r] for c in columns]
            both = row.projected(np.column_stack([row.base, *self._extra[r], *more, row.target]), weight)
            # the residual of a solution is its columns minus the target
            both[:, -1] *= -1.0
            parts.append(both)
        return Normal.of(np.array([y.T @ y for y in parts]), np.array([*self._signs(), *signs]))

    def _r2(self, normal: Normal) -> float:
        return 1.0 - float(np.sum(normal.left_out(self.settings.damping)) / np.sum(normal.square))

    def propose(self, candidates: Sequence[Candidate]) -> list[Proposal]:
        """Return all candidates that act on the motion, best first."""
        found = []
        asked = {
            tuple(sorted(c.one(i).items())): (c.id, c.one(i), c.sizes[i][1])
            for c in candidates
            for i in range(len(c.sizes))
        }
        bare = [self._bare(held=held) for held in (False, True)]
        jobs = self.pool.map(
            lambda item: self._force_columns(item[1], item[2], bare[item[0] in FRICTION_EFFECTS]), asked.values()
        )
        made = dict(zip(asked, jobs, strict=True))
        for candidate in candidates:
            columns = []
            for i in range(len(candidate.sizes)):
                effect = candidate.one(i)
                key = tuple(sorted(effect.items()))
                columns.append(made[key])
            if any(not any(np.any(c) for c in column) for column in columns):
                continue
            signs = [float(parameter(key).lower >= 0.0) for key, _ in candidate.sizes]
            normal = self._normal(columns, signs)
            theta = normal.solve()
            gain = float(np.sum(gains(self.base, normal, self.settings.damping)))
            n = len(self._names())
            start = self._start(theta[:n], theta[n:], candidate)
            found.append(Proposal(candidate, gain, self.r2_before, self._r2(normal), start))
        return sorted(found, key=lambda p: -p.gain)

    def _bare(self, *, held: bool) -> tuple[dict[str, float], list[FloatArray]]:
        """Return the drive that is led along the motions, with or without dry friction, and its accelerations."""
        # not the fitted drive: far from the truth its step may be unstable along the motion
        values = {**self._rough(), **_known(self.values), **self.present}
        if not held:
            values |= dict.fromkeys(("d1", "d2"), 0.0)
        return values, [led(values, m, self._every(m)) for m in self.motions]

    def _force_columns(
        self, effect: Values, size: float, bare: tuple[dict[str, float], list[FloatArray]]
    ) -> list[FloatArray]:
        return [
            _column(force_of(bare[0], effect, m, self._every(m), known) / size, row, self.ratio)
            for m, row, known in zip(self.motions, self.rows, bare[1], strict=True)
        ]

    def _rough(self) -> dict[str, float]:
        """Return a drive of the right size: force over acceleration, and a spring that resonates as such drives do."""
        m = self.motions
        u, a = (np.concatenate([getattr(x, n).ravel() for x in m]) for n in ("command", "acceleration"))
        mass = float(np.sqrt(np.mean(u**2) / max(float(np.mean(a**2)), 1e-300)))
        values = {"m1": mass, "b1": 0.0, "d1": 0.0}
        return values | (
            {"m2": mass, "k": mass * (2.0 * np.pi * 3.0) ** 2, "b2": 0.0, "d2": 0.0} if self.carts == 2 else {}
        )

    def _start(self, base: FloatArray, sizes: FloatArray, candidate: Candidate) -> dict[str, float]:
        c = dict(zip(self._names(), base, strict=True))
        values = _physical(c)
        own = {key: float(theta) * values["m1"] for (key, _), theta in zip(candidate.sizes, sizes, strict=True)}
        return {**values, **candidate.start, **own}


def _rows(m: Motion, ratio: float, *, shared: bool, resting: bool) -> _Rows:
    carts, K = len(m.x), len(m.windows)
    s = m.direction()
    zero = np.zeros(K)
    first = [m.command, m.velocity[0], s[0]]
    if carts == 1:
        use = np.ones(K, dtype=bool) if resting else m.sliding[0]
        return _Rows(np.column_stack(first), m.acceleration[0], np.zeros((K, 0)), use, 1)
    top = np.column_stack([*first, m.deflection, zero, zero, zero])
    bottom = np.column_stack([zero, zero, zero, zero, m.velocity[1], s[1], m.deflection])
    marks = (m.segment[:, None] == np.unique(m.segment)[None, :]).astype(float)
    nothing = np.zeros_like(marks)
    offsets = np.vstack([-marks, ratio * marks]) if shared else np.block([[marks, nothing], [nothing, marks]])
    use = np.ones(2 * K, dtype=bool) if resting else np.concatenate([m.sliding[0], m.sliding[1]])
    return _Rows(np.vstack([top, bottom]), np.concatenate([m.acceleration[0], m.acceleration[1]]), offsets, use, 2)


def _column(force: FloatArray, row: _Rows, ratio: float) -> FloatArray:
    return np.asarray(force[0] if row.carts == 1 else np.concatenate([force[0], ratio * force[1]]))


def _physical(c: Mapping[str, float]) -> dict[str, float]:
    """Return the drive's parameters from the coefficients; what comes out with the wrong sign is made small."""
    m1 = 1.0 / c["1/m1"] if c["1/m1"] > 0.0 else float("nan")
    values = {"m1": m1, "b1": max(-c["-b1/m1"] * m1, 0.0), "d1": max(-c["-d1/m1"] * m1, 0.0)}
    if "k/m2" in c:
        k = -c["-k/m1"] * m1
        m2 = k / c["k/m2"] if c["k/m2"] > 0.0 and k > 0.0 else float("nan")
        values |= {"k": k if k > 0.0 else float("nan"), "m2": m2}
        values |= {"b2": max(-c["-b2/m2"] * m2, 0.0), "d2": max(-c["-d2/m2"] * m2, 0.0)}
    return values


def _known(values: Values) -> dict[str, float]:
    """Return what the equations determine; nothing where a mass or the spring came out with the wrong sign."""
    return dict(values) if all(np.isfinite(v) for v in values.values()) else {}

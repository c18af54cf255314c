"""Shapes without a name: a free function of one variable as the missing force, to be held against the catalogue.

A force on one cart that is any function of one variable (hat functions between knots), or a friction whose level is any
function of one, is put into the simulation like a catalogue entry. Where such a shape explains far more than anything that has
a name, the catalogue does not hold what was left out; the shape is then what can be said.

The variables are those of the model's own motion. Measured ones hold the very error that is to be explained: a force that
follows the measured velocity would steer the model after the rig and explain everything.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from flexdrive_gym.recording import FloatArray
from flexdrive_gym.units import LAB, Units
from identification.mismatch.candidates import Candidate
from identification.mismatch.refit import Fit
from identification.mismatch.screening import Screened, orthonormal
from identification.mismatch.surroundings import against
from identification.mismatch.workbench import Workbench
from identification.replay.output_error import Run, simulate_run

KNOTS = 7
# what a friction's variable begins with, and the unit of every variable
FRICTION = "friction against "
ALONG_TRACK = "the place along the track"
AXES = {
    "v1": "mm/s",
    "v2": "mm/s",
    "u": "V",
    "|u|": "V",
    "δ": "mm",
    "|δ|": "mm",
    "time": "s",
    "the time since a reversal": "s",
    "acceleration of cart 1": "mm/s²",
    "acceleration of cart 2": "mm/s²",
    ALONG_TRACK: "mm",
}
# share of the error that a shape must explain to be called unnamed
WORTH = 0.045
_SIZE_V = 0.05


@dataclass(frozen=True, eq=False)
class Shape:
    """A missing force as a free function of one variable.

    Attributes
    ----------
    where
        ``cart_1`` or ``cart_2``.
    variable
        What it depends on, in words.
    knots, force, band : ndarray, shape (KNOTS,)
        Values of the variable, missing force [V] (friction: against the motion) and standard error over the recordings.
    gain
        Share of the remaining comparable squared error.
    predicted
        The same in recordings left out when the function was found, one at a time; can be negative.
    screened
        The same as a candidate, for chance and likeness.
    probability
        False-alarm probability of the gain among all shapes.
    """

    where: str
    variable: str
    knots: FloatArray
    force: FloatArray
    band: FloatArray
    gain: float
    predicted: float
    screened: Screened
    probability: float = 1.0

    def sentence(self, units: Units = LAB) -> str:
        """Return where it acts, figures in the rig's units."""
        i = int(np.argmax(np.abs(self.force)))
        at = units.text(float(self.knots[i]), AXES[self.variable.removeprefix(FRICTION)], 3)
        size, command = units.of_rig(float(self.force[i]), "V")
        return f"{self.variable}, largest ({size:+.2g} {command}) at {at}"


@dataclass(frozen=True, eq=False)
class _Motion:
    """Simulated motion of one recording: t, u of shape (n,), v of shape (carts, n)."""

    t: FloatArray
    u: FloatArray
    v: FloatArray

    @property
    def delta(self) -> FloatArray:
        return np.asarray(np.cumsum(self.v[0] - self.v[1]) * (self.t[1] - self.t[0]))


def free_shapes(bench: Workbench, model: Fit) -> list[Shape]:
    """Return every free shape's gain on the present model, the one that predicts best first."""
    forces = list(bench.pool.map(lambda run: _motion(model.values, run), bench.runs))
    present = orthonormal(model.jacobian)
    e = model.residual - present @ (present.T @ model.residual)
    families = [f for cart in range(len(forces[0].v)) for f in _families(forces, cart)]
    pushes, sizes = [], []
    for cart, _, values, sign in families:
        knots = _knots(values)
        sizes.append(knots)
        pushes += [partial(hats, cart, k, knots, values, sign) for k in range(len(knots))]
    columns = bench.comparable(bench.pushed(model.values, pushes, _SIZE_V))
    shapes, begin = [], 0
    for (cart, name, _, _), knots in zip(families, sizes, strict=True):
        own = columns[:, begin : begin + len(knots)]
        begin += len(knots)
        shapes.append(_judge(bench, f"cart_{cart + 1}", name, knots, own, e, present))
    return sorted(shapes, key=lambda s: -s.predicted)


def pushed_by(bench: Workbench, values: Mapping[str, float], shape: Shape) -> FloatArray:
    """Return what a shape's force changes in the residual of any recordings of its rig [mm/s], shape (N,)."""
    motions = list(bench.pool.map(lambda run: _motion(values, run), bench.runs))
    cart = int(shape.where[-1]) - 1
    along, sign = next((x, s) for c, name, x, s in _families(motions, cart) if (c, name) == (cart, shape.variable))
    push = [_push(cart, np.interp(x, shape.knots, shape.force) * s) for x, s in zip(along, sign, strict=True)]
    return bench.pushed(values, [lambda: push], 1.0)[:, 0]


def likeness(bench: Workbench, shape: Shape, screened: Sequence[Screened]) -> list[tuple[str, float]]:
    """Return the names nearest to what a shape explains, with |cosine|, most alike first."""
    f: FloatArray = np.asarray(shape.screened.basis @ shape.screened.sizes, dtype=np.float64)
    norm = float(np.linalg.norm(f))
    best: dict[str, float] = {}
    for s in screened:
        if norm > 0.0:
            best[s.candidate.id] = max(best.get(s.candidate.id, 0.0), float(np.sqrt(s.explains(bench, f))) / norm)
    return sorted(best.items(), key=lambda item: -item[1])


def _motion(values: Mapping[str, float], run: Run) -> _Motion:
    v: FloatArray = np.array(simulate_run(values, run))
    t: FloatArray = np.arange(len(run.u), dtype=np.float64) * run.sample_time
    return _Motion(t, run.u, v)


def _families(forces: Sequence[_Motion], cart: int) -> list[tuple[int, str, list[FloatArray], list[FloatArray]]]:
    ones = [np.ones_like(f.t) for f in forces]
    direction = [against(f.v[cart]) for f in forces]
    own = cart + 1
    found = [
        (cart, f"v{own}", [f.v[cart] for f in forces], ones),
        (cart, "u", [f.u for f in forces], ones),
        (cart, f"{FRICTION}|u|", [np.abs(f.u) for f in forces], direction),
        (cart, f"{FRICTION}time", [f.t for f in forces], direction),
        (
            cart,
            f"{FRICTION}the time since a reversal",
            [_since_reversal(f.t, f.v[cart]) for f in forces],
            direction,
        ),
    ]
    if len(forces[0].v) == 2:
        other = 1 - cart
        found += [
            (cart, "δ", [f.delta for f in forces], ones),
            (cart, f"v{other + 1}", [f.v[other] for f in forces], ones),
            (cart, f"acceleration of cart {other + 1}", [np.gradient(f.v[other], f.t) for f in forces], ones),
            (cart, f"{FRICTION}|δ|", [np.abs(f.delta) for f in forces], direction),
        ]
    return found


def _since_reversal(t: FloatArray, v: FloatArray) -> FloatArray:
    turned = np.concatenate(([True], np.sign(v[1:]) != np.sign(v[:-1])))
    return np.asarray(t - np.maximum.accumulate(np.where(turned, t, t[0])))


def _knots(values: Sequence[FloatArray]) -> FloatArray:
    everything = np.concatenate([v[::7] for v in values])
    return np.unique(np.quantile(everything, np.linspace(0.02, 0.98, KNOTS)))


def _hat(x: FloatArray, knots: FloatArray, k: int) -> FloatArray:
    unit = np.zeros(len(knots))
    unit[k] = 1.0
    return np.interp(x, knots, unit)


def hats(
    cart: int, k: int, knots: FloatArray, values: Sequence[FloatArray], sign: Sequence[FloatArray]
) -> list[FloatArray]:
    """Return, for every recording, a force on a cart that is 1 at a knot of a variable and 0 at the others, shape (2, n)."""
    return [_push(cart, _hat(x, knots, k) * s) for x, s in zip(values, sign, strict=True)]


def _push(cart: int, force: FloatArray) -> FloatArray:
    both = np.zeros((2, len(force)))
    both[cart] = force
    return both


def _judge(
    bench: Workbench, where: str, name: str, knots: FloatArray, columns: FloatArray, e: FloatArray, present: FloatArray
) -> Shape:
    beyond = columns - present @ (present.T @ columns)
    basis = orthonormal(beyond)
    amounts = basis.T @ e
    force, *_ = np.linalg.lstsq(beyond, -e, rcond=1e-2)
    left = e + beyond @ force
    inverse = np.linalg.pinv(beyond.T @ beyond, rcond=1e-4, hermitian=True)
    scores = np.array([beyond[bench.rows.of(r)].T @ left[bench.rows.of(r)] for r in range(len(bench.runs))])
    band = np.sqrt(np.maximum(np.diag(inverse @ (scores.T @ scores) @ inverse), 0.0))
    gain = float(amounts @ amounts / (e @ e))
    candidate = Candidate(f"shape of {name}", where, (), ())
    return Shape(
        where,
        name,
        knots,
        np.asarray(force, dtype=np.float64),
        band,
        gain,
        _predicted(bench, beyond, e),
        Screened(candidate, gain, tuple(amounts), 0.0, basis.astype(np.float32), basis[:, :0].astype(np.float32)),
    )


def _predicted(bench: Workbench, beyond: FloatArray, e: FloatArray) -> float:
    rows = [bench.rows.of(r) for r in range(len(bench.runs))]
    H = [beyond[i].T @ beyond[i] for i in rows]
    g = [beyond[i].T @ e[i] for i in rows]
    ridge = 1e-3 * np.trace(sum(H)) / len(H[0]) * np.eye(len(H[0]))
    if not ridge.any():
        # the force does nothing that the fit does not
        return 0.0
    gained = 0.0
    for r, i in enumerate(rows):
        force = -np.linalg.solve(sum(H) - H[r] + ridge, sum(g) - g[r])
        gained += float(e[i] @ e[i] - np.sum((e[i] + beyond[i] @ force) ** 2))
    return gained / float(e @ e)

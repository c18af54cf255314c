"""What a design is, and the choices every family shares: specification, discretisation, feed-forward, tuning."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from math import inf, isfinite
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from baselines.controllers._effective import effective
from baselines.loop_analysis.loops import is_stable, linear_part, loop_response
from flexdrive_gym import Drive, LinearController
from flexdrive_gym.drive.batch.closed_loop import run_batch
from flexdrive_gym.drive.default import HANDOUT_QUANTUM_MM
from flexdrive_gym.recording import FloatArray
from flexdrive_gym.units import measured_in

if TYPE_CHECKING:
    import control

SAMPLE_TIME_S = 1e-3

# Lab 4: reference derivatives are smoothed by a pole at 1000 rad/s
DERIVATIVE_POLE = 1000.0

_TUNING_POINTS = 400
_INTEGRATOR = 1e-7
_TRACKING_S = 0.1


@dataclass(frozen=True)
class Specification:
    """What Lab 4 asks of a loop.

    Attributes
    ----------
    crossover
        [rad/s]
    gain_margin
        Least factor by which the loop gain may be raised [].
    phase_margin_deg
        Least [deg].
    reserve_deg
        Phase kept for the integral action [deg].
    largest_alpha
        Of a lead [].
    """

    crossover: float = field(default=25.0, metadata=measured_in("rad/s"))
    gain_margin: float = 2.0
    phase_margin_deg: float = 30.0
    reserve_deg: float = 10.0
    largest_alpha: float = 25.0

    def __post_init__(self) -> None:
        for name in ("crossover", "gain_margin", "phase_margin_deg", "largest_alpha"):
            value = getattr(self, name)
            if not (value > 0.0 and isfinite(value)):
                raise ValueError(f"{name}: must be a positive number; got {value!r}.")


LAB_4 = Specification()


@dataclass(frozen=True, eq=False)
class Design:
    """A controller and how it came to be.

    Attributes
    ----------
    controller
        Made for one drive.
    title
        In words.
    feedback
        Which encoders it reads.
    values
        Symbol to (value, unit) of what the design computed on the way.
    notes
        What a reader must know, for example which demand could not be met.
    """

    controller: LinearController
    title: str
    feedback: str
    values: Mapping[str, tuple[float, str]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Family:
    """A leaf of the registry: a name, a sentence, and the function that designs the controller for a drive.

    ``design`` takes a drive and a sample time [s]; the command limit is no part of a design and is set afterwards. ``reads`` says
    which encoders the controller hears, whose delays the design has to count.
    """

    name: str
    about: str
    design: Callable[[Drive, float], Design]
    reads: tuple[str, ...] = ("x2",)

    def made(self, drive: Drive, sample_time: float) -> Design:
        """Return the design for a drive as linear theory sees it; a search is done once for the same numbers."""
        return _made(self, tuple(effective(drive, self.reads).values.items()), sample_time)


@lru_cache(maxsize=128)
def _made(family: Family, values: tuple[tuple[str, float], ...], sample_time: float) -> Design:
    return family.design(Drive(dict(values)), sample_time)


def needs_two_carts(drive: Drive, name: str) -> None:
    """Raise where a drive has no second cart to control."""
    if drive.carts != 2:
        raise ValueError(f"drive: {name} controls the second cart; got a rigid drive. Use one with m2 and k.")


def discretised(
    continuous: control.StateSpace,
    name: str,
    *,
    sample_time: float = SAMPLE_TIME_S,
) -> LinearController:
    """Discretise (xr, x1, x2) -> u by Tustin's rule; an integrator is led back while the command is limited."""
    import control  # noqa: PLC0415  (costs a second; used here only)

    sampled = control.sample_system(continuous, sample_time, method="tustin") if continuous.nstates else continuous
    n = sampled.nstates
    A, B = np.asarray(sampled.A).reshape(n, n), np.asarray(sampled.B).reshape(n, 3)
    C, D = np.zeros((2, n)), np.zeros((2, 3))
    C[: sampled.noutputs], D[: sampled.noutputs] = sampled.C, sampled.D
    return LinearController(
        A, B, C, D, sample_time, windup_gain(A, C, sample_time), name=name
    )  # fmt: skip


def windup_gain(A: FloatArray, C: FloatArray, sample_time: float) -> FloatArray:
    """Return L that leads the integrator back while the command is limited, ndarray, shape (n,); zeros without integrator.

    Back-calculation on the integrating mode alone: what the limit cut off moves the integrator so that, by itself, it would undo
    the excess within 0.1 s. The leads are left alone: making them, too, believe the limited command (conditioning) turns a single
    saturating step into a vibration between the limits.
    """
    n = len(A)
    if not n:
        return np.zeros(0)
    values, right = np.linalg.eig(A)
    i = int(np.argmin(np.abs(values - 1.0)))
    if abs(values[i] - 1.0) > _INTEGRATOR:
        return np.zeros(n)
    mode = np.real(right[:, i])
    heard = float(C[0] @ mode)
    return np.zeros(n) if heard == 0.0 else mode / heard * sample_time / _TRACKING_S


def derivative(order: int = 1) -> control.StateSpace:
    """Return (s/(s/1000 + 1))^order."""
    import control  # noqa: PLC0415

    one = control.ss(control.tf([1.0, 0.0], [1.0 / DERIVATIVE_POLE, 1.0]))
    return one if order == 1 else one * derivative(order - 1)


def spring_feed_forward(drive: Drive) -> control.StateSpace:
    """Return (m2·ar + b2·vr)/k, by which cart 1 must lead cart 2 [mm] along the reference."""
    linear = drive.linear
    return (linear.m2 / linear.k) * derivative(2) + (linear.b2 / linear.k) * derivative(1)


def feed_forward(drive: Drive) -> control.StateSpace:
    """Return (m1 + m2)·ar + (b1 + b2)·vr from xr [mm] to command [V]."""
    linear = drive.linear
    mass, damping = (linear.m1, linear.b1) if linear.rigid else (linear.m1 + linear.m2, linear.b1 + linear.b2)
    return mass * derivative(2) + damping * derivative(1)


def gain(matrix: object) -> control.StateSpace:
    """Return a constant gain as a system."""
    import control  # noqa: PLC0415

    return control.ss([], [], [], np.atleast_2d(np.asarray(matrix, dtype=np.float64)))


def stack(*systems: control.StateSpace) -> control.StateSpace:
    """Put systems side by side: each has inputs and outputs of its own."""
    import control  # noqa: PLC0415

    return control.append(*systems)


def tuning_frequencies(drive: Drive) -> FloatArray:
    """Return frequencies at which candidates are judged, ndarray."""
    around = drive.linear.omega_n
    near = np.linspace(0.6 * around, 1.6 * around, _TUNING_POINTS // 4) if isfinite(around) else np.zeros(0)
    return np.union1d(np.geomspace(0.1, 3000.0, _TUNING_POINTS), near)


@dataclass(frozen=True)
class CoarseMargins:
    """Margins read off a frequency grid by linear interpolation, for the inside of a search.

    Attributes
    ----------
    crossover
        Highest [rad/s]; nan where the gain never crosses 1.
    gain_margin
        Upward []; inf where the phase never crosses -180° below a gain of 1.
    phase_margin_deg, delay_margin
        Smallest over all crossovers [deg], [s]; inf where there is none.
    """

    crossover: float
    gain_margin: float
    phase_margin_deg: float
    delay_margin: float


def coarse_margins(L: npt.NDArray[np.complex128], omega: FloatArray) -> CoarseMargins:
    """Return the margins of a sampled frequency response; final figures come from :mod:`baselines.loop_analysis.margins`."""
    size = np.log(np.abs(L))
    i = np.flatnonzero((size[:-1] > 0.0) != (size[1:] > 0.0))
    share = size[i] / (size[i] - size[i + 1])
    at = omega[i] + share * (omega[i + 1] - omega[i])
    phase = np.unwrap(np.angle(L))
    lag = np.mod(phase[i] + share * (phase[i + 1] - phase[i]) + np.pi, 2.0 * np.pi)
    j = np.flatnonzero((L.imag[:-1] > 0.0) != (L.imag[1:] > 0.0))
    part = L.imag[j] / (L.imag[j] - L.imag[j + 1])
    real = L.real[j] + part * (L.real[j + 1] - L.real[j])
    inside = real[(real < 0.0) & (real > -1.0)]
    return CoarseMargins(
        float(at.max()) if len(at) else float("nan"),
        float(-1.0 / inside.min()) if len(inside) else inf,
        float(np.rad2deg(np.min(np.minimum(lag, 2.0 * np.pi - lag), initial=inf))),
        float(np.min(lag / at, initial=inf)) if len(at) else inf,
    )


@dataclass(frozen=True)
class Demands:
    """What every tuned controller must keep, so that all compete with the same margins in hand.

    Attributes
    ----------
    sensitivity
        Largest peak of |1/(1 + L)|: 1.93 implies Lab 4's GM >= 2 and PM >= 30°.
    delay_margin
        Least [s]. Amplifiers and encoders of such rigs are late by up to 5 ms; half of the margin shall be left then.
    count
        Largest jump of the command from one encoder count [V].
    """

    sensitivity: float = 1.93
    delay_margin: float = 0.010
    count: float = 0.25


DEMANDS = Demands()


def count_jump(drive: Drive, controller: LinearController) -> float:
    """Return how far one encoder count moves the command at once [V]; the handout's count where the drive has none."""
    quantum = max(drive["encoder_quantisation.encoder_1.quantum"], drive["encoder_quantisation.encoder_2.quantum"])
    return float(np.max(np.abs(controller.D[0, 1:]))) * (quantum or HANDOUT_QUANTUM_MM)


def _violation(drive: Drive, controller: LinearController, demands: Demands) -> tuple[float, str]:
    """Return by which factor the demand missed most is missed (at most 1: all are met), and its sentence."""
    omega = tuning_frequencies(drive)
    L = loop_response(drive, controller, omega)
    peak = float(np.max(np.abs(1.0 / (1.0 + L))))
    delay = coarse_margins(L, omega).delay_margin
    jump = count_jump(drive, controller)
    found = (
        (peak / demands.sensitivity, f"sensitivity peak {peak:.2f} instead of at most {demands.sensitivity:g}"),
        (demands.delay_margin / max(delay, 1e-9),
         f"delay margin {1e3 * delay:.1f} ms instead of at least {1e3 * demands.delay_margin:g} ms"),
        (jump / demands.count, f"one encoder count moves the command {jump / demands.count:.1f} times as far as demanded"),
    )  # fmt: skip
    return max(found)


def disturbance_area(drive: Drive, controller: LinearController) -> float:
    """Return the area of x2² in the second after 1 V of disturbance stepped on, on the linear drive [mm² s].

    Dry friction does just that to a drive at every reversal.
    """
    n = round(1.0 / controller.sample_time)
    free = controller.replace(limit=inf, friction=0.0)
    run = run_batch([linear_part(drive)], np.zeros(n), free, disturbance=1.0)[0]
    moved = run[2] if drive.carts == 2 else run[0]
    return float(np.sum(moved**2) * controller.sample_time)


def best_of(
    candidates: Iterable[LinearController], drive: Drive, demands: Demands = DEMANDS
) -> tuple[LinearController, str]:
    """Choose among candidates: stable, within the demands, least :func:`disturbance_area`.

    Returns
    -------
    controller
    note
        Empty, or a sentence where no candidate meets the demands; then the one that misses by the smallest factor is chosen.

    Raises
    ------
    ValueError
        If no candidate is stable.
    """
    best, best_score, note = None, (inf, inf), ""
    for candidate in candidates:
        # the cheapest demand first, unless nothing has met it yet
        if best_score[0] <= 1.0 and count_jump(drive, candidate) > demands.count:
            continue
        if not is_stable(drive, candidate):
            continue
        missed, sentence = _violation(drive, candidate, demands)
        score = (max(missed, 1.0), disturbance_area(drive, candidate) if missed <= 1.0 else 0.0)
        if score < best_score:
            best, best_score, note = (
                candidate,
                score,
                "" if missed <= 1.0 else f"no candidate meets the demands: {sentence}",
            )
    if best is None:
        raise ValueError(f"drive: no candidate is stable on {drive.name!r}; check its parameters and input delay.")
    return best, note

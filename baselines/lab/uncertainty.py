r"""Figures of a drive that can be checked on the rig, with the interval that the drive's uncertainty leaves.

:func:`predict` simulates every figure on the drive and on draws of it (:meth:`~flexdrive_gym.Drive.draw`): parameters from the
covariance over recordings, with Student's t, and dry friction as it differs from run to run. The covariance of maximum
likelihood is the sandwich over recordings, the sum of outer products of what each recording by itself moves the parameters by:
the infinitesimal jackknife, to first order what leaving one recording out at a time gives. The interval is of what *another run
of this rig* does.

A prediction *extrapolates* where the motion that it is about leaves what was recorded: command, speed, deflection or frequency.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from math import inf, pi

import numpy as np

from baselines.lab.experiments import STABLE_GAIN, limit_in_the_lab, p_control
from baselines.lab.prediction_names import prediction_name
from baselines.loop_analysis.margins import margins
from baselines.loop_analysis.stability_limit import (
    Feedback,
    critical_gain,
    critical_gain_near,
    critical_motion,
    linear_critical_gain,
    with_rig,
)
from flexdrive_gym import Drive, LinearController, PControl, Recording
from flexdrive_gym.recording import FloatArray
from flexdrive_gym.references import STROKE_MM
from flexdrive_gym.units import LAB, Units

DRAWS = 100
PREDICTION_COLUMNS = ("figure", "of the drive", "median", "95 % interval", "unit", "extrapolated")
_SETTLED_S, _MEAN_S = 6.0, 0.5
# how far beyond what was recorded a motion may go before a prediction of it is called an extrapolation
_BEYOND = 1.1


@dataclass(frozen=True)
class Predicted:
    """One figure of a drive.

    Attributes
    ----------
    name
        For example ``critical_gain_x2_simulated``.
    value
        Of the drive itself; ``None`` where there is no such limit (below 10 V/mm).
    median, ci95
        Over draws of the drive; ``None`` without a covariance. An end that is ``None`` is no limit.
    unit
        Of all of them.
    extrapolated
        Why the prediction leaves what was recorded, in a sentence; ``None`` where it does not, or where the drive does not know.
    draws
        How many.
    """

    name: str
    value: float | None
    median: float | None
    ci95: tuple[float | None, float | None] | None
    unit: str
    extrapolated: str | None
    draws: int

    def of_rig(self, units: Units) -> Predicted:
        """Return the figure as the rig's owner reads it."""
        one = units.one(self.unit)

        def shown(x: float | None) -> float | None:
            return None if x is None else x / one

        interval = None if self.ci95 is None else (shown(self.ci95[0]), shown(self.ci95[1]))
        unit = units.name(self.unit)
        return replace(self, value=shown(self.value), median=shown(self.median), ci95=interval, unit=unit)


@dataclass(frozen=True, eq=False)
class Figure:
    """How one figure is found: of the drive, and of a draw near to it; and the motion it is about."""

    unit: str
    of: Callable[[Drive], float | None]
    near: Callable[[Drive, float | None], float | None]
    motion: Callable[[Drive, float], Recording] | None = None


def predict(
    drive: Drive,
    names: Sequence[str] | None = None,
    *,
    draws: int = DRAWS,
    seed: int = 0,
    threads: int | None = None,
) -> dict[str, Predicted]:
    """Return what a drive predicts of another run of its rig.

    Parameters
    ----------
    drive
        As identified; without a covariance there are no intervals.
    names
        Which figures; default: all that the drive has.
    draws, seed
        How many drives are drawn, and their source.
    threads
        Default: the processors this process may use. The answer does not depend on it.

    Returns
    -------
    dict
        Name to prediction.

    Raises
    ------
    ValueError
        For a name that the drive has no figure of.
    """
    known = figures(drive)
    for name in names or ():
        if name not in known:
            raise ValueError(f"names: must be among {', '.join(known)}; got {name!r}.")
    asked = {name: known[name] for name in (known if names is None else names)}
    drawn = drive.draw(np.random.default_rng(seed), draws) if drive.covariance is not None and draws else []
    values = {name: figure.of(drive) for name, figure in asked.items()}

    def one(other: Drive) -> list[float | None]:
        return [figure.near(other, values[name]) for name, figure in asked.items()]

    with ThreadPoolExecutor(threads or len(os.sched_getaffinity(0))) as pool:
        table = list(pool.map(one, drawn))
    columns = zip(*table, strict=True) if table else [()] * len(asked)
    return {
        name: _predicted(name, values[name], list(column), figure, drive)
        for (name, figure), column in zip(asked.items(), columns, strict=True)
    }


def _predicted(name: str, value: float | None, column: list[float | None], figure: Figure, drive: Drive) -> Predicted:
    median, interval = None, None
    if column:
        drawn = np.array([inf if x is None else x for x in column])
        # between a limit and none there is nothing to interpolate
        low, middle, high = np.quantile(drawn, [0.025, 0.5, 0.975], method="nearest")
        median, interval = _finite(middle), (_finite(low), _finite(high))
    why = None if value is None or figure.motion is None else extrapolation(drive, figure.motion(drive, value))
    return Predicted(name, value, median, interval, figure.unit, why, len(column))


def _finite(x: float) -> float | None:
    return float(x) if np.isfinite(x) else None


def extrapolation(drive: Drive, motion: Recording) -> str | None:
    """Return where a motion leaves what a drive was identified from, in a sentence; ``None`` where it stays within.

    Parameters
    ----------
    motion
        With positions; velocities are their differences where there are none.
    """
    reached = drive.recorded
    if reached is None:
        return None
    places = [x for x in (motion.x1, motion.x2) if x is not None]
    width = max(1, round(5e-3 / motion.sample_time))
    speed = max(float(np.max(np.abs(x[width:] - x[:-width]))) for x in places) / (width * motion.sample_time)
    found = [("the command", float(np.max(np.abs(motion.u))), reached.u, "V"), ("a cart", speed, reached.v, "mm/s")]
    if len(places) > 1:
        found.append(("the deflection", float(np.max(np.abs(places[0] - places[1]))), reached.deflection, "mm"))
    beyond = [
        f"{what} reaches {drive.units.text(value, unit, 3)}, {drive.units.text(limit, unit, 3)} were recorded"
        for what, value, limit, unit in found
        if value > _BEYOND * limit
    ]
    frequency = _frequency(places[0] - places[1], motion.sample_time) if len(places) > 1 else None
    if frequency is not None and not reached.slowest / _BEYOND <= frequency <= _BEYOND * reached.fastest:
        beyond.append(
            f"it vibrates at {frequency:.3g} Hz, {reached.slowest:.3g} to {reached.fastest:.3g} Hz were recorded"
        )
    return f"In the predicted motion {'; '.join(beyond)}." if beyond else None


def _frequency(deflection: FloatArray, sample_time: float) -> float | None:
    """Return the frequency at which a spring vibrates most [Hz]; ``None`` where it rests."""
    moved = (deflection - deflection.mean()) * np.hanning(len(deflection))
    power = np.abs(np.fft.rfft(moved)) ** 2
    strongest = int(np.argmax(power))
    return strongest / (len(deflection) * sample_time) if power[strongest] > 0.0 else None


def figures(drive: Drive) -> dict[str, Figure]:
    """Return every figure that a drive has, by name."""
    feedback: Feedback = "x2" if drive.carts == 2 else "x1"
    found: dict[str, Figure] = {}
    for x in ("x1", "x2")[: drive.carts]:
        found |= _limits(x)  # type: ignore[arg-type]
    if drive.carts == 2:
        found["critical_gain_x2_trajectory"] = Figure(
            "V/mm", limit_in_the_lab, _near_in_the_lab, lambda d, gain: p_control(d, gain, "x2")
        )
        found["resonance_hz"] = _plain("Hz", _resonance)
        found["damping_ratio"] = _plain("1", lambda d: d.linear.zeta if d.linear.omega_d > 0.0 else None)
    found["steady_error"] = _plain("mm", lambda d: settled_error(d, feedback))
    return found


def _plain(unit: str, of: Callable[[Drive], float | None]) -> Figure:
    return Figure(unit, of, lambda d, _value: of(d))


def _limits(feedback: Feedback) -> dict[str, Figure]:
    def motion(drive: Drive, gain: float) -> Recording:
        return critical_motion(drive, gain, feedback)

    def linear(drive: Drive) -> float | None:
        return linear_critical_gain(drive, feedback)

    def margin(drive: Drive) -> float | None:
        return phase_margin(drive, feedback)

    return {
        f"critical_gain_{feedback}_linear": _plain("V/mm", linear),
        f"critical_gain_{feedback}_simulated": Figure(
            "V/mm",
            lambda d: critical_gain(d, feedback),
            lambda d, value: critical_gain_near(d, feedback, value),
            motion,
        ),
        f"phase_margin_{feedback}": _plain("deg", margin),
    }


def _resonance(drive: Drive) -> float | None:
    return drive.linear.omega_n / (2.0 * pi) if drive.linear.omega_d > 0.0 else None


def phase_margin(drive: Drive, feedback: Feedback, gain: float = STABLE_GAIN) -> float | None:
    r"""Return the smallest phase margin of the linear loop with P-control [deg]; None where its gain never crosses 1.

    The crossovers are the roots of :math:`|D(j\omega)|^2 = K_p^2 |N(j\omega)|^2`, a polynomial in ω².
    """
    linear = drive.linear
    N, D = gain * linear.numerator(feedback), linear.denominator
    difference = np.polysub(_squared(D), _squared(N))
    roots = np.roots(difference)
    real = roots[(np.abs(roots.imag) < 1e-9 * np.abs(roots)) & (roots.real > 0.0)].real
    s = 1j * np.sqrt(real)
    phases = np.degrees(np.angle(np.polyval(N, s) / np.polyval(D, s)))
    margins = (phases + 180.0 + 180.0) % 360.0 - 180.0
    return float(margins[np.argmin(np.abs(margins))]) if len(margins) else None


def _squared(coefficients: FloatArray) -> FloatArray:
    """Return |P(jω)|² as a polynomial in ω², highest power first."""
    n = len(coefficients) - 1
    # P(jω)·P(-jω): even powers of s, s² = -ω²
    mirrored = coefficients * (-1.0) ** (n - np.arange(n + 1))
    product = np.polymul(coefficients, mirrored)
    return np.asarray(product[::2] * (-1.0) ** (n - np.arange(n + 1)))


def _near_in_the_lab(drive: Drive, value: float | None) -> float | None:
    return limit_in_the_lab(drive) if value is None else limit_in_the_lab(drive, near=value)


def settled_error(drive: Drive, feedback: Feedback = "x2", gain: float = STABLE_GAIN) -> float:
    """Return xr - x that P-control leaves after a step of 50 mm, mean over the last half second of six [mm]."""
    t = np.arange(round(_SETTLED_S / 1e-3)) * 1e-3
    run = with_rig(drive).simulate_closed_loop(t, np.full(len(t), STROKE_MM), PControl(gain, feedback))
    x = run.x1 if feedback == "x1" else run.x2
    assert x is not None
    return float(STROKE_MM - np.mean(x[-round(_MEAN_S / 1e-3) :]))


@dataclass(frozen=True)
class LoopUncertainty:
    """What a drive's uncertainty leaves of a loop that was designed for the drive itself.

    Attributes
    ----------
    unstable
        Share of the draws on which the linear loop is unstable, 0…1.
    ci95
        Of ``crossover`` [rad/s], ``gain_margin`` and ``phase_margin_deg``, in the rig's units, over the stable ones; empty where
        hardly any is.
    draws
        How many.
    """

    unstable: float
    ci95: dict[str, tuple[float, float]]
    draws: int


def loop_uncertainty(
    drive: Drive, controller: LinearController, *, draws: int = DRAWS, seed: int = 0
) -> LoopUncertainty | None:
    """Return the margins of a controller on the draws that :func:`predict` uses; ``None`` for a drive without covariance."""
    if drive.covariance is None or not draws:
        return None
    found = [margins(other, controller) for other in drive.draw(np.random.default_rng(seed), draws)]
    stable = [m for m in found if m.stable]
    names = ("crossover", "gain_margin", "phase_margin_deg") if len(stable) > 1 else ()
    ones = {"crossover": drive.units.one("rad/s")}
    ci95 = {
        name: tuple(
            float(x) / ones.get(name, 1.0)
            for x in np.quantile([getattr(m, name) for m in stable], [0.025, 0.975], method="nearest")
        )
        for name in names
    }
    return LoopUncertainty(1.0 - len(stable) / draws, ci95, draws)  # type: ignore[arg-type]


def limit_in_words(x: float | None, digits: int = 4) -> str:
    """Return a figure that may have no limit, for people."""
    return "no limit" if x is None else f"{x:.{digits}g}"


def interval_in_words(p: Predicted, digits: int = 4) -> str:
    """Return the 95 % interval of a prediction, for people; a dash without one."""
    if p.ci95 is None or p.ci95 == (None, None):
        return "–"
    low, high = (limit_in_words(x, digits) for x in p.ci95)
    return f"{low} … {high}"


def prediction_rows(predicted: Iterable[Predicted], units: Units = LAB) -> list[tuple[str, ...]]:
    """Return a row of cells, under ``PREDICTION_COLUMNS``, for every prediction that was drawn."""
    return [
        (
            prediction_name(p.name, units),
            limit_in_words(p.value),
            limit_in_words(p.median),
            interval_in_words(p),
            p.unit,
            "yes" if p.extrapolated else "no",
        )
        for p in (p.of_rig(units) for p in predicted if p.draws)
    ]


def reasons(predicted: Iterable[Predicted], units: Units = LAB) -> list[str]:
    """Return why predictions extrapolate, one sentence for each of them."""
    return [
        f"Extrapolated: {prediction_name(p.name, units)}. {p.extrapolated}"
        for p in predicted
        if p.extrapolated is not None
    ]

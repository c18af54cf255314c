"""Lab 4: notch, double lead, integral action and feed-forward around G2, designed to its specification.

With s-domain symbols of the handout,

    u = N(s)·[Kp·((αT·s + 1)/(T·s + 1))²·(1 + ωi/s)·(xr - x2) + (m1 + m2)·ar + (b1 + b2)·vr],
    N(s) = (s² + 2ζωn·s + ωn²)/(s² + 2ωn·s + ωn²).

Each stage adds one element to the one before; the last is the whole controller. Kp, the leads and the integral are computed at
the demanded crossover, all from the identified drive; an input delay of the drive counts in the phase.

The handout's rule (the leads keep 10° in reserve, the integral takes just these) looks at the phase margin alone. On the sampled
loop it may miss the gain margin, or lose the half sample of the hold. :func:`refine` therefore varies the reserve and the
integral's frequency until every line of the specification holds on the sampled loop at exactly the demanded crossover, and
keeps the pair that rejects disturbances best.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from math import asin, degrees, inf, radians, sin, sqrt, tan
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import brentq

from baselines.controllers._design import (
    LAB_4,
    SAMPLE_TIME_S,
    CoarseMargins,
    Design,
    Family,
    Specification,
    coarse_margins,
    discretised,
    disturbance_area,
    feed_forward,
    gain,
    needs_two_carts,
    stack,
    tuning_frequencies,
)
from baselines.controllers.p_control import gain_for_phase_margin, proportional
from baselines.loop_analysis.loops import ComplexArray, is_stable, linear_part, response, sampled_drive
from flexdrive_gym import Drive, LinearController

if TYPE_CHECKING:
    import control

STAGES = ("p_x2", "notch", "lead", "integral", "lab4")


@dataclass(frozen=True)
class Lab4:
    """Every number of the design by hand.

    Attributes
    ----------
    gain_limit, gain_pm30
        P-control from x2: largest gain (PM = 0°), and with PM = 30° [V/mm].
    notch_gain_pm30, notch_crossover
        With the notch, regaining PM = 30° [V/mm], and its crossover [rad/s].
    omega_n, zeta
        Of the notch [rad/s], [].
    phase_deg
        Of G2·notch at the demanded crossover [deg].
    phi_max_deg
        Lead demanded of each of the two [deg].
    alpha, T, Z, P
        Of each lead: α [], T [s], zero 1/(αT) and pole 1/T [rad/s].
    Kp
        [V/mm]
    omega_i
        Of the integral action [rad/s].
    shortfall_deg
        Phase that the leads cannot give at the largest α [deg]; 0 where they can.
    reserve_deg
        Phase beyond the margin that the leads provide [deg].
    """

    gain_limit: float
    gain_pm30: float
    notch_gain_pm30: float
    notch_crossover: float
    omega_n: float
    zeta: float
    phase_deg: float
    phi_max_deg: float
    alpha: float
    T: float
    Z: float
    P: float
    Kp: float
    omega_i: float
    shortfall_deg: float
    reserve_deg: float

    def table(self) -> dict[str, tuple[float, str]]:
        """Return symbol to (value, unit), in the order of the handout's steps."""
        return {
            "Kp at PM = 0°": (self.gain_limit, "V/mm"),
            "Kp at PM = 30°": (self.gain_pm30, "V/mm"),
            "ωn": (self.omega_n, "rad/s"),
            "ζ": (self.zeta, "–"),
            "Kp with notch, PM = 30°": (self.notch_gain_pm30, "V/mm"),
            "crossover with notch": (self.notch_crossover, "rad/s"),
            "∠G2·notch at crossover": (self.phase_deg, "deg"),
            "reserve": (self.reserve_deg, "deg"),
            "φmax": (self.phi_max_deg, "deg"),
            "α": (self.alpha, "–"),
            "T": (self.T, "s"),
            "Z = 1/(αT)": (self.Z, "rad/s"),
            "P = 1/T": (self.P, "rad/s"),
            "Kp": (self.Kp, "V/mm"),
            "ωi": (self.omega_i, "rad/s"),
        }


def notch_response(s: Any, omega_n: float, zeta: float) -> Any:
    """Return N(s) for one s or an array of them."""
    return (s**2 + 2.0 * zeta * omega_n * s + omega_n**2) / (s**2 + 2.0 * omega_n * s + omega_n**2)


def design_lab_4(drive: Drive, specification: Specification = LAB_4) -> Lab4:
    """Compute every number of Lab 4's design.

    Parameters
    ----------
    drive
        With two carts; its linear part and input delay count.
    specification
        Crossover, margins, reserve for the integral, largest α.

    Raises
    ------
    ValueError
        For a rigid drive.
    """
    needs_two_carts(drive, "Lab 4")
    linear, wc = drive.linear, specification.crossover
    wn, zeta = linear.omega_n, linear.zeta
    limit, _w = gain_for_phase_margin(drive, 0.0)
    pm30, _w = gain_for_phase_margin(drive, specification.phase_margin_deg)

    def plant(omega: float) -> complex:
        """Return G2·notch with the integrator's turn taken out, so that its phase is continuous from 0."""
        G = complex(linear.frequency_response(omega, "x2", velocity=True)) * notch_response(1j * omega, wn, zeta)
        return complex(G * np.exp(-1j * omega * drive["input_delay.tau"]))

    def phase(omega: float) -> float:
        grid = np.geomspace(1e-3, omega, 400)
        return degrees(np.unwrap(np.angle([plant(float(w)) for w in grid]))[-1]) - 90.0

    demanded = specification.phase_margin_deg - 180.0
    notch_wc = float(brentq(lambda w: phase(w) - demanded, 1e-2, 3000.0, xtol=1e-9))
    notch_gain = notch_wc / abs(plant(notch_wc))

    start = Lab4(
        limit, pm30, notch_gain, notch_wc, wn, zeta, phase(wc), *(0.0,) * 8, specification.reserve_deg
    )  # fmt: skip
    return _with_leads(start, drive, specification, specification.reserve_deg)


def _with_leads(values: Lab4, drive: Drive, specification: Specification, reserve_deg: float) -> Lab4:
    """Compute leads, Kp and integral for a reserve of phase [deg]."""
    wc = specification.crossover
    # PM and the reserve for the integral: Lab 4 demands -140° = -180° + 30° + 10°
    phi = 0.5 * (specification.phase_margin_deg - 180.0 + reserve_deg - values.phase_deg)
    largest = degrees(asin((specification.largest_alpha - 1.0) / (specification.largest_alpha + 1.0)))
    used = min(max(phi, 0.0), largest)
    alpha = (1.0 + sin(radians(used))) / (1.0 - sin(radians(used)))
    T = 1.0 / (wc * sqrt(alpha))
    # at its centre each lead has the gain √α, so two have α
    G = complex(drive.linear.frequency_response(wc, "x2", velocity=False))
    Kp = 1.0 / (abs(G * notch_response(1j * wc, values.omega_n, values.zeta)) * alpha)
    return replace(
        values, phi_max_deg=phi, alpha=alpha, T=T, Z=1.0 / (alpha * T), P=1.0 / T, Kp=Kp, reserve_deg=reserve_deg,
        # the integral takes atan(ωi/ωc) of phase, just the reserve
        omega_i=wc * tan(radians(reserve_deg)), shortfall_deg=2.0 * max(0.0, phi - largest),
    )  # fmt: skip


def refine(drive: Drive, specification: Specification = LAB_4, sample_time: float = SAMPLE_TIME_S) -> tuple[Lab4, bool]:
    """Vary reserve and integral until the sampled loop meets the whole specification.

    Returns
    -------
    Lab4
        The pair with the least :func:`~baselines.controllers._design.disturbance_area`; the handout's own where none meets it.
    met
        Whether every line holds.
    """
    kept = {name: drive[name] for name in linear_part(drive).values}
    return _refined(tuple(kept.items()), specification, sample_time)


@lru_cache(maxsize=32)
def _refined(
    values: tuple[tuple[str, float], ...], specification: Specification, sample_time: float
) -> tuple[Lab4, bool]:
    drive = Drive(dict(values))
    first = design_lab_4(drive, specification)
    omega = tuning_frequencies(drive)
    A, B, C = sampled_drive(drive, sample_time)
    at = np.append(omega, specification.crossover)
    plant = response(A, B, C[1:], np.zeros((1, 1)), at, sample_time)[:, 0, 0]
    # Tustin's rule maps the unit circle onto the imaginary axis: s = 2/Ts·j·tan(ωTs/2)
    s = 2.0 / sample_time * 1j * np.tan(0.5 * sample_time * at)

    def crossing(trial: Lab4) -> tuple[Lab4, ComplexArray]:
        """Return the design whose sampled loop crosses 1 at the demanded frequency, and that loop's response."""
        L = (
            notch_response(s, trial.omega_n, trial.zeta)
            * (trial.alpha * trial.T * s + 1.0) ** 2
            / (trial.T * s + 1.0) ** 2
        )
        L = L * (1.0 + trial.omega_i / s) * plant
        return replace(trial, Kp=1.0 / abs(L[-1])), L[:-1] / abs(L[-1])

    largest = degrees(asin((specification.largest_alpha - 1.0) / (specification.largest_alpha + 1.0)))
    highest = 2.0 * largest + 180.0 - specification.phase_margin_deg + first.phase_deg
    best, best_area = first, inf
    for reserve in np.arange(2.0, highest, 2.0):
        leads = _with_leads(first, drive, specification, float(reserve))
        low, high, found = 0.0, specification.crossover * tan(radians(min(float(reserve), 80.0))), None
        for _ in range(12):
            middle = 0.5 * (low + high)
            trial, L = crossing(replace(leads, omega_i=middle))
            if _meets(coarse_margins(L, omega), specification):
                low, found = middle, trial
            else:
                high = middle
        if found is None:
            continue
        controller = _feedback_controller(found, sample_time)
        if is_stable(drive, controller):
            area = disturbance_area(drive, controller)
            if area < best_area:
                best, best_area = found, area
    return best, best_area < inf


def _meets(found: CoarseMargins, specification: Specification) -> bool:
    # a hair above, because the frequencies are coarse
    return (
        found.gain_margin >= 1.002 * specification.gain_margin
        and found.phase_margin_deg >= specification.phase_margin_deg + 0.05
        and found.crossover <= 1.002 * specification.crossover
    )


def _feedback_controller(values: Lab4, sample_time: float) -> LinearController:
    path = feedback_path(values, leads=True, integral=True, gain_value=values.Kp)
    return discretised(
        notch(values) * path * gain([[1.0, 0.0, -1.0]]), "integral", sample_time=sample_time
    )  # fmt: skip


def notch(values: Lab4) -> control.StateSpace:
    """Return the notch N(s)."""
    import control  # noqa: PLC0415  (costs a second; used here only)

    wn = values.omega_n
    return control.ss(control.tf([1.0, 2.0 * values.zeta * wn, wn**2], [1.0, 2.0 * wn, wn**2]))


def feedback_path(values: Lab4, *, leads: bool, integral: bool, gain_value: float) -> control.StateSpace:
    """Return the controller on the error, without the notch."""
    import control  # noqa: PLC0415

    path = gain(gain_value)
    if leads:
        lead = control.ss(control.tf([values.alpha * values.T, 1.0], [values.T, 1.0]))
        path = lead * lead * path
    if integral:
        path = control.ss(control.tf([1.0, values.omega_i], [1.0, 0.0])) * path
    return path


def stage(
    name: str,
    drive: Drive,
    *,
    sample_time: float = SAMPLE_TIME_S,
    specification: Specification = LAB_4,
    by_the_handout: bool = False,
) -> Design:
    """Return one stage of Lab 4, discretised.

    Parameters
    ----------
    name
        One of :data:`STAGES`.
    drive
        With two carts.
    by_the_handout
        Keep the handout's reserve and integral instead of refining them on the sampled loop.

    Raises
    ------
    ValueError
        For an unknown stage or a rigid drive.
    """
    if name not in STAGES:
        raise ValueError(f"name: must be among {', '.join(STAGES)}; got {name!r}.")
    needs_two_carts(drive, name)
    values, met = design_lab_4(drive, specification), True
    if name in {"integral", "lab4"} and not by_the_handout:
        values, met = refine(drive, specification, sample_time)
    notes = shortfalls(values, specification)
    if not met:
        notes += ("no lead and integral meet the whole specification on the sampled loop; the handout's are kept",)
    if name == "p_x2":
        return Design(proportional(values.gain_pm30, "x2", sample_time), "P from x2, PM = 30°", "x2", values.table())
    leads, integral = name != "notch", name in {"integral", "lab4"}
    path = feedback_path(
        values, leads=leads, integral=integral, gain_value=values.Kp if leads else values.notch_gain_pm30
    )
    if name == "lab4":
        inside = gain([[1.0, 1.0]]) * stack(path, feed_forward(drive)) * gain([[1.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
    else:
        inside = path * gain([[1.0, 0.0, -1.0]])
    whole = notch(values) * inside
    controller = discretised(whole, name, sample_time=sample_time)
    return Design(controller, TITLES[name], "x2", values.table(), notes)


TITLES = {
    "p_x2": "P from x2, PM = 30°",
    "notch": "P with notch, PM = 30°",
    "lead": "notch and double lead",
    "integral": "notch, double lead and integral",
    "lab4": "Lab 4: notch, double lead, integral, feed-forward",
}


def shortfalls(values: Lab4, specification: Specification) -> tuple[str, ...]:
    """Say what the leads cannot give."""
    if values.shortfall_deg <= 0.0:
        return ()
    said = (
        f"each lead should give {values.phi_max_deg:.1f}°; with α ≤ {specification.largest_alpha:g} two leads are "
        f"{values.shortfall_deg:.1f}° short of the phase margin"
    )
    return (said,)


def _family(name: str) -> Family:
    def design(drive: Drive, sample_time: float) -> Design:
        return stage(name, drive, sample_time=sample_time)

    return Family(name, TITLES[name], design)


FAMILIES = tuple(_family(name) for name in STAGES if name != "p_x2")

"""P-control, labs 3 and 4: u = Kp·(xr - x) with a phase margin of 30°, from x2 (non-collocated) or x1 (collocated)."""

from __future__ import annotations

from typing import Literal

import numpy as np
from scipy.optimize import brentq

from baselines.controllers._design import LAB_4, SAMPLE_TIME_S, Design, Family, needs_two_carts
from flexdrive_gym import Drive, LinearController

Feedback = Literal["x1", "x2"]


def proportional(gain: float, feedback: Feedback = "x2", sample_time: float = SAMPLE_TIME_S) -> LinearController:
    """Return u = Kp·(xr - x) as a linear controller."""
    D = np.zeros((2, 3))
    D[0] = gain, (-gain if feedback == "x1" else 0.0), (-gain if feedback == "x2" else 0.0)
    return LinearController(np.zeros((0, 0)), np.zeros((0, 3)), np.zeros((2, 0)), D, sample_time, name=f"p_{feedback}")


def gain_for_phase_margin(drive: Drive, phase_margin_deg: float, feedback: Feedback = "x2") -> tuple[float, float]:
    """Return the P gain that leaves a phase margin, and its crossover.

    The drive's phase falls steadily from -90° for feedback from x2; from x1 the last crossing of the demanded phase is taken.

    Returns
    -------
    Kp
        [V/mm]; at a phase margin of 0 the largest stable gain.
    omega
        [rad/s]

    Raises
    ------
    ValueError
        If the phase never reaches what the margin leaves.
    """
    tau = drive["input_delay.tau"]

    def lag(omega: np.ndarray | float) -> np.ndarray:
        w = np.atleast_1d(np.asarray(omega, dtype=np.float64))
        G = drive.linear.frequency_response(w, feedback, velocity=True)
        # the velocity response begins at 0°, so unwrapping cannot miss a turn; the integrator takes 90°
        return np.asarray(np.rad2deg(np.unwrap(np.angle(G))) - 90.0 - np.rad2deg(w * tau))

    grid = np.geomspace(1e-3, 3000.0, 4000)
    excess = lag(grid) + 180.0 - phase_margin_deg
    above = np.flatnonzero((excess[:-1] > 0.0) & (excess[1:] <= 0.0))
    if not len(above):
        raise ValueError(
            f"phase_margin_deg: the phase from {feedback} must fall to {phase_margin_deg - 180.0:g}°; it ends at "
            f"{lag(grid)[-1]:.1f}°. Every gain has a larger margin."
        )
    i = int(above[-1])
    below = _response(drive, float(grid[i]), feedback)

    def margin_left(omega: float) -> float:
        # between two neighbours of the grid the phase turns by far less than half a turn
        return float(excess[i] + np.angle(_response(drive, omega, feedback) / below, deg=True))

    omega = float(brentq(margin_left, grid[i], grid[i + 1], xtol=1e-12))
    return 1.0 / abs(_response(drive, omega, feedback)), omega


def _response(drive: Drive, omega: float, feedback: Feedback) -> complex:
    G = drive.linear.frequency_response(omega, feedback, velocity=False)
    return complex(G * np.exp(-1j * omega * drive["input_delay.tau"]))


def _design(feedback: Feedback) -> Family:
    def design(drive: Drive, sample_time: float) -> Design:
        notes: tuple[str, ...] = ()
        if feedback == "x2":
            needs_two_carts(drive, "p_x2")
        try:
            Kp, omega = gain_for_phase_margin(drive, LAB_4.phase_margin_deg, feedback)
        except ValueError:
            omega = LAB_4.crossover
            Kp = 1.0 / abs(_response(drive, omega, feedback))
            notes = (f"every gain leaves more than 30°; Kp crosses 1 at {omega:g} rad/s",)
        values = {"Kp": (Kp, "V/mm"), "crossover": (omega, "rad/s")}
        where = "second cart, non-collocated" if feedback == "x2" else "motor cart, collocated"
        return Design(
            proportional(Kp, feedback, sample_time), f"P from {feedback}, PM = 30° ({where})", feedback, values, notes
        )

    return Family(f"p_{feedback}", f"P-control from {feedback} with a phase margin of 30°", design, (feedback,))


FAMILIES = (_design("x2"), _design("x1"))

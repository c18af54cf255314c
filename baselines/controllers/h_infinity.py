r"""H∞ loop shaping from x2: the most robust controller for a shaped plant, by python-control and slycot.

The plant is shaped by :math:`W = K_W (s + \omega_i)/s`; :math:`G_s = G_2 W` is then stabilised against perturbations of its
normalised coprime factors, that is

.. math::
   \left\| \begin{pmatrix} I \\ K \end{pmatrix} (I + G_s K)^{-1} \begin{pmatrix} I & G_s \end{pmatrix} \right\|_\infty
   = \gamma = 1/\varepsilon

is made as small as it can be (D. McFarlane, K. Glover, IEEE Trans. Automatic Control 37, 1992); the controller is
:math:`W K`. The shaped loop's crossover is chosen for the largest disturbance rejection with Lab 4's margins in hand.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from baselines.controllers._design import (
    Design,
    Family,
    best_of,
    discretised,
    feed_forward,
    gain,
    needs_two_carts,
    stack,
)
from flexdrive_gym import Drive, LinearController

if TYPE_CHECKING:
    import control

_CROSSOVERS = np.geomspace(6.0, 40.0, 12)
_INTEGRAL = 0.15


def coprime_stabiliser(shaped: control.StateSpace) -> tuple[control.StateSpace, float]:
    """Return the controller K (negative feedback) that is most robust for a shaped plant, and γ = 1/ε.

    Raises
    ------
    ImportError
        Without slycot.
    """
    try:
        import control  # noqa: PLC0415
        import slycot  # noqa: F401, PLC0415
    except ImportError as error:
        raise ImportError(
            "slycot: H∞ synthesis needs it; it is not installed. pip install 'flexdrive[control]'."
        ) from error
    A, B, C = (np.asarray(m) for m in (shaped.A, shaped.B, shaped.C))
    n = len(A)
    # w = (disturbance at the plant's input, noise at its output), z = (plant's output, command); y = -(output + noise)
    P = control.ss(
        A,
        np.hstack([B, np.zeros((n, 1)), B]),
        np.vstack([C, np.zeros((1, n)), -C]),
        np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
    )
    K, _closed, gamma, _rcond = control.hinfsyn(P, 1, 1)
    return K, float(gamma)


def _law(drive: Drive, crossover: float) -> tuple[control.StateSpace, float]:
    import control  # noqa: PLC0415

    G = drive.linear.transfer_function("x2")
    at = abs(complex(drive.linear.frequency_response(crossover, "x2", velocity=False)))
    W = control.ss(control.tf([1.0, _INTEGRAL * crossover], [1.0, 0.0])) * gain(1.0 / at)
    # the half sample of the hold and the drive's delay are part of the plant that is made robust
    delay = drive["input_delay.tau"]
    G = control.ss(G)
    if delay > 0.0:
        G = G * control.ss(control.tf(*control.pade(delay, 2)))
    K, gamma = coprime_stabiliser(G * W)
    path = stack(W * K, feed_forward(drive))
    return gain([[1.0, 1.0]]) * path * gain([[1.0, 0.0, -1.0], [1.0, 0.0, 0.0]]), gamma


def _design(drive: Drive, sample_time: float) -> Design:
    needs_two_carts(drive, "h_infinity")
    tried: list[tuple[LinearController, float, float]] = []
    for crossover in _CROSSOVERS:
        law, gamma = _law(drive, float(crossover))
        tried.append((discretised(law, "h_infinity", sample_time=sample_time), float(crossover), gamma))
    best, note = best_of([c for c, _w, _g in tried], drive)
    _c, crossover, gamma = next(item for item in tried if item[0] is best)
    values = {"shaped crossover": (crossover, "rad/s"), "γ": (gamma, "–"), "ε = 1/γ": (1.0 / gamma, "–")}
    return Design(best, "H∞ loop shaping from x2 with feed-forward", "x2", values, (note,) if note else ())


FAMILIES = (Family("h_infinity", "H∞ loop shaping from x2 with feed-forward (slycot)", _design),)

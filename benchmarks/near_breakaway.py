"""How well the model of the noise tells friction of a run that holds a cart which would slide without it.

``python -m benchmarks near_breakaway``. Cart 2 of the handout's rig has a quarter more dry friction in one recording of a sine,
at frequencies at which it slides, hardly moves, and rests. Printed are the squares of what the filter that whitens leaves: of the
drive with its usual friction; with as much of each direction as leaves the least (the force along the measured motion; the
derivative of the simulation; the secant to a quarter more; what the diagnosis takes), and of the drive with that friction. Then
the same at one frequency for a cart whose friction is of bristles. Writes a picture of that frequency to ``benchmarks/out``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from flexdrive_gym import DEFAULT_DRIVE, Excitation, Recording
from flexdrive_gym.drive.default import HANDOUT_QUANTUM_MM
from flexdrive_gym.recording import FloatArray
from flexdrive_gym.references import sine
from identification.mismatch.fitting.bench import Bench, Values
from identification.mismatch.fitting.thread_pool import ThreadPool
from identification.mismatch.noise.breakaway import with_secants
from identification.mismatch.noise.estimate import first_noise
from identification.mismatch.noise.nuisance import Direction, directions, friction_of
from identification.mismatch.settings import Settings
from identification.plots.style import new_figure, save_png

OUT = Path(__file__).parent / "out"
USUAL = {name: value for name, value in DEFAULT_DRIVE.values.items() if "." not in name}
AMPLITUDE_V, MORE = 2.5, 0.25
FREQUENCIES_HZ, SHOWN_HZ = (3.0, 3.5, 4.0, 4.5, 5.0, 6.0), 4.0
# lengths over which friction bends before it slides, and its share that does
BRISTLES_MM, BENDING = (0.005, 0.02, 0.1), 0.95
# rms of a force that the command does not show [V], and step of the derivative
_FORCE_V, _STEP = 0.05, 0.01


def main() -> None:
    print(
        "| sine of 2.5 V at | usual friction | force along the motion | derivative | secant | in the diagnosis | its own |"
    )
    print("|---|---|---|---|---|---|---|")
    with ThreadPool(1) as pool:
        for frequency in FREQUENCIES_HZ:
            bench = Bench([recording(frequency, USUAL)], pool, Settings())
            found = left(bench, USUAL)
            print(_row(f"{frequency:g} Hz", found))
            if frequency == SHOWN_HZ:
                path = save_png(_plot(bench, found), OUT / "near_breakaway.png", 120)
        for length in BRISTLES_MM:
            usual = _bending(length)
            found = left(Bench([recording(SHOWN_HZ, usual)], pool, Settings()), usual)
            print(_row(f"{SHOWN_HZ:g} Hz, bristles of {length:g} mm", found))
    print(f"wrote {path}")


def _row(what: str, found: Mapping[str, FloatArray]) -> str:
    return f"| {what} | " + " | ".join(f"{x @ x:.0f}" for x in found.values()) + " |"


def recording(frequency: float, usual: Values) -> Recording:
    """Return a recording of a sine in which cart 2 has more friction than usual, under a force that the command does not show."""
    t = np.arange(2501) * 1e-3
    u = sine(t, AMPLITUDE_V, frequency)
    force = _FORCE_V * np.random.default_rng(0).normal(size=len(t))
    made = DEFAULT_DRIVE.replace(**_rubbing(usual, MORE)).simulate(t, u + force, name="sine")
    excitation = Excitation("sine", AMPLITUDE_V, frequency)
    return replace(made, u=u, x1=None, x2=None, excitation=excitation, quantum=(HANDOUT_QUANTUM_MM,) * 2)


def left(bench: Bench, usual: Values) -> dict[str, FloatArray]:
    """Return what the filter leaves of the rows by the column of the table, ndarray, shape (N,)."""
    noise, found = first_noise(bench, usual), directions(bench, usual)
    whitened = noise.innovations
    here, own = bench.residual(usual), bench.residual(_rubbing(usual, MORE))
    ways = {
        "force along the motion": _change(found),
        "derivative": bench.residual(_rubbing(usual, _STEP)) - bench.residual(_rubbing(usual, -_STEP)),
        "secant": own - here,
        "in the diagnosis": _change(with_secants(bench, usual, found, noise)),
    }
    e = whitened(here)
    rest = {"usual friction": e}
    for name, way in ways.items():
        D = whitened(way)
        rest[name] = e - D * (D @ e) / (D @ D)
    return {**rest, "its own friction": whitened(own)}


def _change(found: Sequence[Direction]) -> FloatArray:
    return next(d.change for d in found if d.group == friction_of(1))


def _bending(length: float) -> dict[str, float]:
    """Return the usual drive with most friction of cart 2 in bristles of a length [mm]."""
    d2 = USUAL["d2"]
    return {**USUAL, "d2": (1.0 - BENDING) * d2, "presliding.cart_2.fd": BENDING * d2, "presliding.cart_2.xs": length}


def _rubbing(usual: Values, share: float) -> dict[str, float]:
    more = {n: (1.0 + share) * usual[n] for n in ("d2", "presliding.cart_2.fd") if n in usual}
    return {**usual, **more}


def _plot(bench: Bench, found: dict[str, FloatArray]) -> Figure:
    figure = new_figure(5.0)
    above, below = figure.subplots(2, 1, sharex=True)
    rows, run = bench.pieces[1].rows, bench.runs[0]
    t = np.arange(rows.stop - rows.start) * run.block * run.sample_time
    sampled = np.arange(len(run.u)) * run.sample_time
    above.plot(sampled, run.measured[1], color="0.6", linewidth=0.8, label="measured")
    for name, values in (("usual friction", USUAL), ("a quarter more", _rubbing(USUAL, MORE))):
        # what is simulated is what is measured less the rows
        above.plot(t, _mean(run.measured[1], run.block) - bench.residual(values)[rows], linewidth=1.2, label=name)
    for name in ("force along the motion", "derivative", "in the diagnosis"):
        below.plot(t, found[name][rows], linewidth=1.0, label=name)
    above.set_ylabel("velocity of\ncart 2 [mm/s]")
    below.set_ylabel("left by the filter\n[standard deviations]")
    below.set_xlabel("t [s]")
    above.set_xlim(1.0, 1.75)
    for axes in (above, below):
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    return figure


def _mean(x: FloatArray, block: int) -> FloatArray:
    edges = np.arange(0, len(x), block)
    return np.asarray(np.add.reduceat(x, edges) / np.diff([*edges, len(x)]))

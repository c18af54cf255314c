"""How well the model of the noise tells friction of a run that holds a cart which would slide without it.

``python -m benchmarks near_breakaway``. Cart 2 of the handout's rig has a quarter more dry friction in one recording of a sine,
at frequencies at which it slides, hardly moves, and rests. Printed are the squares of what the filter that whitens leaves: of the
drive with its usual friction; with as much of each direction as leaves the least (the force along the measured motion, which the
diagnosis has; the derivative of the simulation; the secant to a quarter more), and of the drive with that friction.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from flexdrive_gym import Drive, Excitation
from flexdrive_gym.recording import FloatArray
from flexdrive_gym.references import sine
from identification.mismatch.fitting.bench import Bench
from identification.mismatch.fitting.thread_pool import ThreadPool
from identification.mismatch.noise.estimate import first_noise
from identification.mismatch.noise.nuisance import directions
from identification.mismatch.settings import Settings
from identification.plots.style import new_figure, save_png

OUT = Path(__file__).parent / "out"
RIG = {"m1": 7.6e-4, "m2": 3.4e-4, "b1": 0.0096, "b2": 0.0032, "d1": 0.357, "d2": 0.241, "k": 0.095}
COUNT_MM, AMPLITUDE_V, MORE = 0.0046592, 2.5, 0.25
FREQUENCIES_HZ, SHOWN_HZ = (3.0, 3.5, 4.0, 4.5, 5.0, 6.0), 4.0
# rms of a force that the command does not show [V], and step of the derivative
_FORCE_V, _STEP = 0.05, 0.01


def main() -> None:
    table = Table(
        "frequency [Hz]", "usual friction", "force along the motion", "derivative", "secant", "its own friction"
    )
    with ThreadPool(1) as pool:
        for frequency in FREQUENCIES_HZ:
            table.add_row(f"{frequency:g}", *(f"{s:.0f}" for s in left(frequency, pool)))
    Console().print(table)
    print(f"wrote {OUT / 'near_breakaway.png'}")


def left(frequency: float, pool: ThreadPool) -> list[float]:
    """Return the squares that are left, in the order of the table."""
    t = np.arange(2501) * 1e-3
    u = sine(t, AMPLITUDE_V, frequency)
    counts = {f"encoder_quantisation.encoder_{i}.quantum": COUNT_MM for i in (1, 2)}
    force = _FORCE_V * np.random.default_rng(0).normal(size=len(t))
    rubbing = _with_more(MORE)
    run = replace(Drive({**rubbing, **counts}).simulate(t, u + force, name="sine"), u=u, x1=None, x2=None)
    recording = replace(run, excitation=Excitation("sine", AMPLITUDE_V, frequency), quantum=(COUNT_MM, COUNT_MM))
    bench = Bench([recording], pool, Settings())
    noise, here, own = first_noise(bench, RIG), bench.residual(RIG), bench.residual(rubbing)
    along = next(d.change for d in directions(bench, RIG) if d.group == "friction of cart 2")
    derivative = (bench.residual(_with_more(_STEP)) - bench.residual(_with_more(-_STEP))) / (2.0 * _STEP)
    if frequency == SHOWN_HZ:
        _plot(bench, here, [along, derivative, (own - here) / MORE], noise.innovations)
    white, *ways = (noise.innovations(x) for x in (here, along, derivative, (own - here) / MORE))
    by_direction = [float(white @ white - (white @ D) ** 2 / (D @ D)) for D in ways]
    return [float(white @ white), *by_direction, float(np.sum(noise.innovations(own) ** 2))]


def _with_more(share: float) -> dict[str, float]:
    return {**RIG, "d2": RIG["d2"] * (1.0 + share)}


def _plot(bench: Bench, here: FloatArray, ways: list[FloatArray], whitened: Callable[[FloatArray], FloatArray]) -> None:
    figure = new_figure(5.0)
    axes = figure.subplots(2, 1, sharex=True)
    rows = bench.pieces[1].rows
    t = np.arange(rows.stop - rows.start) * bench.runs[0].block * bench.runs[0].sample_time
    named = zip(("force along the motion", "derivative", "secant"), ways, strict=True)
    lines = [("what is to be explained", here), *((name, -MORE * D) for name, D in named)]
    for name, x in lines:
        axes[0].plot(t, x[rows], label=name, linewidth=1.0)
        axes[1].plot(t, whitened(x)[rows], linewidth=1.0)
    axes[0].set_ylabel("cart 2, measured\nminus simulated [mm/s]")
    axes[1].set_ylabel("whitened [1]")
    axes[1].set_xlabel("t [s]")
    axes[0].set_xlim(1.0, 1.75)
    axes[0].legend(loc="upper right")
    save_png(figure, OUT / "near_breakaway.png", 120)

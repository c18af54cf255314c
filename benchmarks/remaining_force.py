"""What is left of the handout's own rig: the remaining force on both carts against everything, and how much of it is run-to-run.

``python -m benchmarks remaining_force`` fits the free drive to the recordings of 2022 in ``../shared/recordings``, draws what its
equations still lack against every signal, with bands over recordings, to ``benchmarks/out/remaining_force.png``, and prints two
floors. That of *periods* is what differs between the periods of one run. That of *replicates* is what differs between runs
of one command, which 2022 does not have: 2025 says by what factor it is larger. What is between the replicates' floor and the
model's error is physics that is the same in every run.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from flexdrive_gym import Recording
from identification import identify, read_recordings
from identification.floor import by_phase, period_samples, replicates, smoothed, spread
from identification.likelihood import usable
from identification.mismatch.force.maps import UNITS, Map, draw_maps
from identification.mismatch.force.missing_force import missing_force
from identification.plots.style import CART, new_figure, save_png
from identification.replay.output_error import prepare, simulate_run
from identification.signals import motions

DATA = Path(__file__).parents[2] / "shared" / "recordings"
OUT = Path(__file__).parent / "out"
RIG, REPLICATED = "mte360_2022", "mte360_2025"
# mean over 5 ms: encoder counts are no run-to-run variability
_BLOCK_S = 0.005


def main() -> None:
    missing = [name for name in (RIG, REPLICATED) if not (DATA / name).is_dir()]
    if missing:
        print(f"skipped: no recordings in {', '.join(f'../shared/recordings/{name}' for name in missing)}")
        return
    runs, _ = usable(read_recordings(DATA / RIG))
    values = dict(identify(runs).drive.values)
    maps = draw_maps([missing_force(values, r) for r in runs])
    OUT.mkdir(exist_ok=True)
    print(f"wrote {save_png(picture(maps), OUT / 'remaining_force.png', 110)}")
    for where in ("cart_1", "cart_2"):
        best = [m for m in maps if m.where == where][:3]
        print(f"{where}: rms {best[0].size:.3f} V; " + "; ".join(f"{m.variable} {m.explained:.0%}" for m in best))
    factor = _factor(usable(read_recordings(DATA / REPLICATED))[0])
    print(f"{REPLICATED}: variance between replicates over that between periods of one run, v1 and v2: {_two(factor)}")
    error, periods = _errors(values, runs), _between_periods(runs)
    between = periods * factor
    print(f"{RIG}: mean square of the error, of periods, of replicates (estimated) [(mm/s)²]: "
          f"{_two(error)}; {_two(periods)}; {_two(between)}")  # fmt: skip
    print(f"{RIG}: share of the squared error that is run-to-run: {_two(np.minimum(between / error, 1.0))}")


def picture(maps: Sequence[Map]) -> Figure:
    """Draw every cart's remaining force against every signal; the band is twice the standard error over recordings."""
    names = list(dict.fromkeys(("v1", "v2", "δ", "u", "x1", "x2", "t")))
    figure = new_figure(5.0)
    axes = figure.subplots(2, len(names), sharey="row", sharex="col")
    for m in maps:
        row, column = int(m.where == "cart_2"), names.index(m.variable)
        ax = axes[row, column]
        order = np.argsort(m.centre)
        x, y, band = m.centre[order], m.mean[order], 2.0 * m.band[order]
        ax.axhline(0.0, color="0.8", lw=0.7)
        ax.fill_between(x, y - band, y + band, color=CART[row + 1], alpha=0.25, lw=0.0)
        ax.plot(x, y, color=CART[row + 1], lw=1.2)
        ax.set_title(f"{max(m.explained, 0.0):.0%}", fontsize=7.5, loc="right")
        ax.tick_params(labelsize=6.5)
        if row:
            ax.set_xlabel(f"{m.variable} [{UNITS[m.variable]}]", fontsize=8)
        if not column:
            ax.set_ylabel(f"force left on cart {row + 1} [V]", fontsize=8)
    return figure


def _errors(values: dict[str, float], runs: Sequence[Recording]) -> np.ndarray:
    """Return the mean squared error of 5 ms means of v1 and v2, shape (2,), over runs that repeat themselves."""
    squares = []
    for r in runs:
        if period_samples(r) <= 1.0:
            continue
        run = prepare(r)
        simulated = simulate_run(values, run)
        errors = [np.where(k, m - s, np.nan) for m, s, k in zip(run.measured, simulated, run.keep, strict=True)]
        squares.append([float(np.nanmean(_block_means(e, r) ** 2)) for e in errors])
    return np.mean(squares, axis=0)


def _between_periods(runs: Sequence[Recording]) -> np.ndarray:
    """Return the variance between the periods of one run, v1 and v2, mean over runs."""
    found = [[spread(rows)[0] for rows in _folded(r)] for r in runs if period_samples(r) > 1.0]
    return np.nanmean(found, axis=0)


def _factor(runs: Sequence[Recording]) -> np.ndarray:
    """Return the variance between replicates over that between periods of one run, v1 and v2, shape (2,)."""
    groups: list[list[Recording]] = []
    for r in runs:
        if period_samples(r) <= 1.0:
            continue
        group = next((g for g in groups if replicates(g[0], r)), None)
        groups.append([r]) if group is None else group.append(r)
    together, alone = [], []
    for group in groups:
        if len(group) < 3:
            continue
        folded = [_folded(r) for r in group]
        alone.append(np.nanmean([[spread(rows)[0] for rows in f] for f in folded], axis=0))
        # one row a run, its own periods averaged: what is left between rows is the run's
        together.append(
            [spread(np.vstack([np.nanmean(f[c][:, : _width(folded, c)], axis=0) for f in folded]))[0] for c in (0, 1)]
        )
    within, between = np.mean(alone, axis=0), np.mean(together, axis=0)
    return np.asarray((within + between) / within)


def _width(folded: Sequence[Sequence[np.ndarray]], channel: int) -> int:
    return min(f[channel].shape[1] for f in folded)


def _folded(r: Recording) -> list[np.ndarray]:
    """Return v1 and v2 folded onto the period of the command, as 5 ms means."""
    speeds, keep = motions(r)
    width = max(1, round(_BLOCK_S / r.sample_time))
    return [
        by_phase(smoothed(v, k, width) / np.sqrt(width), period_samples(r)) for v, k in zip(speeds, keep, strict=True)
    ]


def _block_means(values: np.ndarray, r: Recording) -> np.ndarray:
    width = max(1, round(_BLOCK_S / r.sample_time))
    return smoothed(values, np.isfinite(values), width) / np.sqrt(width)


def _two(pair: np.ndarray) -> str:
    return ", ".join(f"{x:.3g}" for x in pair)

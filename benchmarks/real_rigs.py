"""The identification of two real rigs, a table of docs/methods.md, and a picture; the recordings are not part of the repository.

``python -m benchmarks real_rigs`` looks for them in ``../shared/recordings`` beside the repository.
"""

import time
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from baselines.loop_analysis.stability_limit import observed_limit, stability_limit
from flexdrive_gym import Recording
from identification import identify, read_recordings, validate
from identification.likelihood import identify_by_likelihood, improvement
from identification.plots.style import moving_mean, save_png
from identification.quantities import HANDOUT_RATIOS
from identification.validation import simulate_like

ROOT = Path(__file__).parents[1]
DATA = ROOT.parent / "shared" / "recordings"
RIGS = ("mte360_2022", "mte360_2025")


def main() -> None:
    if not DATA.is_dir():
        print("skipped: no recordings in ../shared/recordings")
        return
    rows = [row(name) for name in RIGS]
    titles = ["", *RIGS]
    print("| " + " | ".join(titles) + " |")
    print("|---" * len(titles) + "|")
    for label in rows[0]:
        print(f"| {label} | " + " | ".join(r[label] for r in rows) + " |")
    picture(read_recordings(DATA / RIGS[0]))


def row(name: str) -> dict[str, str]:
    begin = time.perf_counter()
    runs = read_recordings(DATA / name)
    reading = time.perf_counter() - begin
    handout = identify(runs, "handout")
    begin = time.perf_counter()
    free = identify_by_likelihood(runs)
    seconds = time.perf_counter() - begin
    tied = identify_by_likelihood(runs, ties=HANDOUT_RATIOS)
    validation = validate(free.drive, runs)
    limit, observed = stability_limit(free.drive, "x2"), observed_limit(runs)
    by_hand = stability_limit(handout.drive, "x2")
    seen = f"{observed.holds:.4g} holds" + (f", {observed.grows:.4g} grows" if observed.grows else " (largest tried)")
    faults = [f for r in runs for f in r.faults if f.id != "saturation"]
    return {
        "recordings, sensor faults found": f"{len(runs)}, {len(faults)}",
        "rms error, handout 3.2 [mm/s]": f"{validate(handout.drive, runs).rms:.1f}",
        "rms error, ML with the handout's ratios": f"{tied.rms:.1f}",
        "rms error, ML with free ratios": f"{free.rms:.1f}",
        "floor: what does not repeat": f"{validation.floor:.1f}",
        "squared error cut by freeing the ratios": f"{improvement(tied, free):.0%}",
        "α, β, γ (handout 0.54, 0.1, 0.1)": ", ".join(f"{free.ratios[n].value:.2f}" for n in HANDOUT_RATIOS),
        "critical gain from x2, handout 3.2, linear [V/mm]": f"{by_hand.critical_gain_linear:.3f}",
        "critical gain, ML, linear": f"{limit.critical_gain_linear:.3f}",
        "critical gain, ML, simulated with friction": f"{limit.critical_gain_simulated:.3f}",
        "critical gain on the rig": seen,
        "time to read, to fit [s]": f"{reading:.1f}, {seconds:.1f}",
    }


def picture(runs: tuple[Recording, ...]) -> None:
    measured = next(r for r in runs if r.excitation.kind == "square" and r.excitation.amplitude > 1.9)
    models = {
        "Lab 3 handout's method": identify(runs, "handout").drive,
        "maximum likelihood, free ratios": identify(runs).drive,
    }
    figure = Figure(figsize=(9.0, 4.2), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True, sharey=True)
    part = (measured.t >= 2.9) & (measured.t <= 5.0)
    width = round(0.01 / measured.sample_time)
    for column, (label, drive) in enumerate(models.items()):
        simulated = simulate_like(drive, measured)
        for line, (channel, colour) in enumerate((("v1", "#1f5a94"), ("v2", "#d1660f"))):
            ax = axes[line, column]
            y, y_hat = getattr(measured, channel), getattr(simulated, channel)
            ax.plot(measured.t[part], moving_mean(y, width)[part], color="0.25", lw=0.9, label="measured")
            ax.plot(measured.t[part], y_hat[part], color=colour, lw=1.6, label="simulated")
            keep = measured.valid(channel)
            rms = float(np.sqrt(np.mean((y - y_hat)[keep] ** 2)))
            ax.set_title(f"cart {channel[1]}: {label}, rms {rms:.1f} mm/s", fontsize=9, loc="left")
            ax.grid(color="0.9", lw=0.6)
            ax.spines[["top", "right"]].set_visible(False)
            if column == 0:
                ax.set_ylabel(f"$v_{channel[1]}$ [mm/s]")
            ax.legend(loc=(0.3, 0.32), fontsize=8, frameon=False)
        axes[1, column].set_xlabel("time [s]")
    save_png(figure, ROOT / "docs" / "real_rig.png", 120)
    print("wrote docs/real_rig.png")

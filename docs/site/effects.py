"""A picture of every effect of the catalogue, from the simulation: the effect present against absent.

``python -m docs.site.effects -o FOLDER`` writes them all.
"""

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from baselines.lab_page.chart import Chart
from baselines.lab_page.signature import plainly_present, signature
from baselines.loop_analysis.stability_limit import with_rig
from flexdrive_gym import DEFAULT_DRIVE, Drive
from flexdrive_gym.drive.effects import EFFECTS, LAYOUT, Effect
from flexdrive_gym.references import sine
from identification.plots.style import CART, REFERENCE, legend_above, new_figure, save_png, styled

_WINDOW_S = 1.4
_BINS = 24
# the laboratory rig's own values are shown
_OWN = {"coulomb_friction", "viscous_friction"}
# plainly present is not enough for the command of the picture
_SHOWN = {"saturation": {"saturation.limit": 2.0, "saturation.softness": 0.0}}


def _pair(effect: Effect) -> tuple[Drive, Drive, dict[str, float]]:
    """Return the drive without and with an effect, and what was changed."""
    rig = with_rig(DEFAULT_DRIVE)
    if effect.id == "spring":  # without it both carts are one
        return Drive({f"{name}1": rig[f"{name}1"] + rig[f"{name}2"] for name in "mbd"}), rig, {"k": rig["k"]}
    changes = _SHOWN.get(effect.id) or plainly_present(effect, effect.where[0])
    if effect.id in _OWN:  # both carts have it
        changes = {name: rig[name] for name, slot in LAYOUT.items() if slot.effect is effect}
    without = rig.replace({name: LAYOUT[name].parameter.null for name in changes})
    return without, without.replace(changes), changes


def _quiet(drive: Drive, effect: Effect) -> Drive:
    """Return a drive whose encoders do not count, so that a small difference is seen."""
    counts = {n: 0.0 for n, slot in LAYOUT.items() if slot.effect.id == "encoder_quantisation" and n in drive.values}
    return drive if effect.id == "encoder_quantisation" else drive.replace(counts)


def _follows(chart: Chart) -> float:
    """Return how much of a missing force's variance a function of this chart's variable explains."""
    explained, total = 0.0, 0.0
    for dots in chart.series:
        x, y = (np.array([np.nan if v is None else v for v in values]) for values in (dots.x, dots.y))
        good = np.isfinite(x) & np.isfinite(y)
        x, y = x[good], y[good]
        if len(x) < 2 * _BINS or np.ptp(x) == 0.0:
            continue
        place = np.digitize(x, np.quantile(x, np.linspace(0.0, 1.0, _BINS + 1)[1:-1]))
        total += float(np.sum((y - y.mean()) ** 2))
        means = np.array([y[place == b].mean() if np.any(place == b) else y.mean() for b in range(_BINS)])
        explained += float(np.sum((means[place] - y.mean()) ** 2))
    return explained / total if total > 0.0 else 0.0


def caption(effect: Effect) -> str:
    """Return the sentence below an effect's picture."""
    changed = ", ".join(
        f"{n} = {v:.3g} {LAYOUT[n].parameter.unit}".removesuffix(" 1") for n, v in _pair(effect)[2].items()
    )
    left = f"With {changed} (solid) and without (dashed); below, the difference."
    if effect.base:
        return left
    return f"{left} Right: the force that a drive without the effect misses, from the encoders."


@styled
def picture(effect: Effect) -> Any:
    """Return the figure: velocity with and without the effect, and the force that is missing without it."""
    without, present, changes = _pair(effect)
    t = np.arange(8001) * 1e-3
    u = sine(t, 2.0, 0.7) * (0.75 + 0.35 * np.sin(2.0 * np.pi * 0.13 * t)) + sine(t, 1.0, 2.3)
    runs = [_quiet(drive, effect).simulate(t, u) for drive in (present, without)]
    pairs = zip(
        *((r.v1, r.v1 if r.v2 is None else r.v2) for r in runs), strict=True
    )  # without a spring both carts are one
    off = [np.abs(a - b) for a, b in pairs]
    cart = int(np.argmax([np.sqrt(np.mean(np.square(o))) for o in off]))
    width = round(_WINDOW_S / 1e-3)
    gathered = np.convolve(np.square(off[cart]), np.ones(width), "valid")
    shown = slice(int(np.argmax(gathered)), int(np.argmax(gathered)) + width)
    figure = new_figure(3.6)
    grid = figure.add_gridspec(2, 2 - effect.base, height_ratios=[3, 2])
    above = figure.add_subplot(grid[0, 0])
    below = figure.add_subplot(grid[1, 0], sharex=above)
    with_it, without_it = ((r.v1, r.v1 if r.v2 is None else r.v2)[cart][shown] for r in runs)
    above.plot(t[shown], without_it, color=REFERENCE, linestyle="--", linewidth=1.2, label="without")
    above.plot(t[shown], with_it, color=CART[cart + 1], linewidth=1.2, label="with")
    above.set(ylabel=f"$v_{cart + 1}$ [mm/s]")
    above.tick_params(labelbottom=False)
    legend_above(above)
    below.plot(t[shown], with_it - without_it, color=CART[cart + 1], linewidth=1.0)
    below.set(xlabel="t [s]", ylabel="difference")
    if effect.base:
        return figure
    right = figure.add_subplot(grid[:, 1])
    chart = max(signature(without, changes), key=_follows)
    for dots, colour in zip(chart.series, (CART[1], CART[2]), strict=True):
        right.plot(dots.x, dots.y, ".", markersize=2.0, color=colour, label=dots.name)
    right.set(xlabel=chart.x.label, ylabel=chart.y.label, ylim=(chart.y.low, chart.y.high))
    legend_above(right)
    return figure


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("-o", "--output", type=Path, required=True)
    folder = options.parse_args().output
    folder.mkdir(parents=True, exist_ok=True)
    for effect in EFFECTS:
        print(save_png(picture(effect), folder / f"{effect.id}.png", 110), flush=True)


if __name__ == "__main__":
    main()

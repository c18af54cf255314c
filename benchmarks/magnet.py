"""A magnet beside the track: in nobody's catalogue, and met by every run at another place. What does the diagnosis draw of it?

``python -m benchmarks magnet`` conceals one (``baselines.rig_simulator``), diagnoses the recordings, and writes
``docs/magnet.png``: the force as it was found, and as it was concealed. Places have no common zero, so the concealed one is
moved to where it fits best.
"""

import json
import tempfile
from pathlib import Path

import numpy as np

from baselines.rig_simulator.make import make_case
from benchmarks.overlay import DOCS
from flexdrive_gym.recording import FloatArray
from identification import diagnose
from identification.plots import plot_curve, style

SEED, SIZE = 1, 1.0


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        recordings, sealed = Path(folder) / "recordings", Path(folder) / "truth.json"
        make_case(recordings, sealed, SEED, "outside", SIZE, ("magnet_detent", "outside"))
        found = diagnose(recordings)
        numbers = json.loads(sealed.read_text(encoding="utf-8"))["effects"][0]["parameters"]
    print(found)
    if found.unnamed is None or found.unnamed.curve is None:
        print("no free shape was found: nothing is drawn")
        return
    curve = found.unnamed.curve

    def concealed(at: float) -> FloatArray:
        z = (curve.at - at) / numbers["detent_width"]
        return np.asarray(-numbers["detent"] * z * np.exp(0.5 - 0.5 * z**2))

    errors = [float(np.sum((curve.force - concealed(at)) ** 2)) for at in curve.at]
    true = concealed(float(curve.at[int(np.argmin(errors))]))
    figure = plot_curve(curve, found.unnamed.where)
    (axes,) = figure.axes
    axes.plot(curve.at, true, color=style.COMMAND, linewidth=1.2, linestyle="--", label="concealed")
    axes.lines[0].set_label("found ± 2 s.e.")
    axes.legend(loc="best")
    print(f"wrote {style.save_png(figure, DOCS / 'magnet.png', 120)}")
    explained = 1.0 - np.sum((curve.force - true) ** 2) / np.sum(true**2)
    print(f"the found force has {explained:.0%} of the concealed one's square right")

"""The README's picture: measured against simulated on the bundled sample, before and after the missing physics is named.

``python -m benchmarks overlay`` writes ``docs/overlay.png`` and, of the same diagnosis, ``docs/missing_force.png``.
"""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from baselines.lab.sample import FOLDER
from baselines.report import words
from identification import Diagnosis, diagnose
from identification.mismatch.answer.remaining import remaining, replay
from identification.plots import plot_before_after, plot_telling_map
from identification.plots.style import save_png

DOCS = Path(__file__).parents[1] / "docs"


def main() -> None:
    write(diagnose(FOLDER), DOCS)


def write(found: Diagnosis, folder: Path) -> None:
    runs = {r.name: r for r in found.split.report}
    fits = [f for f in found.per_recording if f.recording in runs]
    best = max(fits, key=lambda f: f.before_rms - f.after_rms)
    run = runs[best.recording]
    before, after = (replay(drive, run) for drive in (found.base, found.drive))
    with ThreadPoolExecutor(2) as pool:
        forces = remaining(found, pool)
    named = words.listed(words.effect_name(f.id) for f in found.findings) if found.findings else "nothing"
    i = forces.most_telling()
    for name, figure in (
        ("overlay", plot_before_after(run, before, after, titles=("before", f"{named} named"))),
        (
            "missing_force",
            plot_telling_map(forces.measured, forces.before[i], forces.left, forces.supply[i], forces.after[i]),
        ),
    ):
        print(f"wrote {save_png(figure, folder / f'{name}.png', 120)}: {run.name}, {run.excitation}")

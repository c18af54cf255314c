"""Controllers and the stability limit: margins by trial, time of the comparison, and the real rig of winter 2022.

``python -m benchmarks controllers`` looks for the recordings in ``../shared/recordings`` beside the repository, writes
``docs/p_control_overlay.png`` from them, and says so where they are absent.
"""

import os
import time
from dataclasses import replace

import numpy as np

from baselines.compare import cases_of, compare, entries, headline
from baselines.lab.experiments import limit_in_the_lab
from baselines.loop_analysis.empirical_margins import empirical_margins
from baselines.loop_analysis.margins import margins
from baselines.loop_analysis.stability_limit import grows, observed_limit, stability_limit
from benchmarks.real_rigs import DATA, ROOT
from flexdrive_gym import DEFAULT_DRIVE, Covariance, Drive, Recording
from identification import identify, read_recordings
from identification.plots.style import save_png
from identification.validation import simulate_like

RIG = "mte360_2022"
TEN = ("p_x2", "p_x1", "lead", "lab4", "lab4_friction", "pd_x1", "cascade", "cascade_friction", "lqg", "lqg_both")


def main() -> None:
    drive, runs = DEFAULT_DRIVE, None
    if DATA.is_dir():
        runs = read_recordings(DATA / RIG)
        drive = identify(runs).drive
    else:
        print(f"no recordings in ../shared/recordings: the documented default drive stands in for {RIG}")
        names = ("m1", "m2", "b1", "b2", "d1", "d2", "k")
        matrix = np.diag([(0.02 * drive[n]) ** 2 for n in names])
        drive = drive.replace(covariance=Covariance(names, matrix))
    agreement(drive)
    speed(drive)
    table(drive)
    if runs is None:
        print(
            "skipped, needs the recordings: critical gain beside the measured one, overlay of the P-control recordings"
        )
        return
    limits(drive, runs)
    overlay(drive, runs)


def agreement(drive: Drive) -> None:
    """Print margins by python-control beside margins by trial."""
    print(
        "\n| controller | GM | by trial | delay margin [ms] | by trial | largest difference |\n|---|---|---|---|---|---|"
    )
    worst = 0.0
    for entry in entries(drive)[0]:
        a, e = margins(drive, entry.controller), empirical_margins(drive, entry.controller)
        off = max(abs(e.gain_margin / a.gain_margin - 1.0), abs(e.delay_margin / a.delay_margin - 1.0))
        worst = max(worst, off)
        print(
            f"| {entry.name} | {a.gain_margin:.4g} | {e.gain_margin:.4g} | {1e3 * a.delay_margin:.4g} | "
            f"{1e3 * e.delay_margin:.4g} | {off:.2%} |"
        )
    print(f"largest difference of all: {worst:.2%} (demanded: 2 %)")


def speed(drive: Drive) -> None:
    """Time 500 draws of ten controllers, 4 s each; designs are made before."""
    chosen = entries(drive, TEN)[0]
    cases = cases_of(drive, draws=500, effects=False, references=())
    compare(
        drive, chosen[:1], cases=cases[:2], empirical=False, backend="sequential"
    )  # compile, or load what was compiled
    for backend, jobs in (("sequential", 1), ("threading", 2)):
        begin = time.perf_counter()
        compare(drive, chosen, cases=cases, empirical=False, backend=backend, jobs=jobs)  # type: ignore[arg-type]
        seconds = time.perf_counter() - begin
        steps = len(chosen) * len(cases) * 4000 / seconds
        print(f"500 draws × {len(chosen)} controllers × 4 s, {backend}, {jobs} of {os.cpu_count()} cores: {seconds:.1f} s "
              f"({steps / 1e6:.1f} million steps/s with measures; demanded: 60 s)")  # fmt: skip


def table(drive: Drive) -> None:
    """Print the table of all controllers."""
    chosen, skipped = entries(drive, limit=8.0)
    found = compare(drive, chosen, limit=8.0, empirical=False, backend="threading", jobs=2, skipped=skipped)
    print(
        "\n| controller | rms e [mm] | peak [mm] | settling [s] | overshoot [%] | rms u [V] | GM | PM [deg] | delay [ms] | "
        "disk | rejection [V/mm] | success over draws | effects survived |\n" + "|---" * 13 + "|"
    )
    for r in found.results:
        m, n = r.nominal, r.margins
        assert n is not None
        settling = f"{m.settling:.2f}" if np.isfinite(m.settling) else "–"
        draws = "–" if r.draws is None else f"{r.draws.value:.1%}"
        effects = "–" if r.effect_share is None else f"{r.effect_share.hits} of {r.effect_share.trials}"
        print(
            f"| {r.entry.name} | {m.rms:.2f} | {m.peak:.1f} | {settling} | {m.overshoot:.1f} | {m.effort:.2f} | "
            f"{n.gain_margin:.3g} | {n.phase_margin_deg:.1f} | {1e3 * n.delay_margin:.1f} | {n.disk_margin:.2f} | "
            f"{n.stiffness:.3g} | {draws} | {effects} |"
        )
    for sentence in headline(found):
        print(sentence)


def limits(drive: Drive, runs: tuple[Recording, ...]) -> None:
    """Print predicted critical gains beside the measured one."""
    found, observed = stability_limit(drive, "x2"), observed_limit(runs)
    student = limit_in_the_lab(drive)
    by_hand = stability_limit(identify(runs, "handout").drive, "x2")
    print("\n| critical gain from x2 | V/mm | against the rig |\n|---|---|---|")
    for name, value in (
        ("linear, handout's identification", by_hand.critical_gain_linear),
        ("linear, maximum likelihood", found.critical_gain_linear),
        ("simulated, four seconds of the trajectory as the students judged", student),
        ("simulated, one move and hold", found.critical_gain_simulated),
    ):
        assert value is not None
        assert observed.holds is not None
        print(f"| {name} | {value:.4f} | {value / observed.holds - 1.0:+.0%} |")
    print(f"| on the rig | {observed.holds:.4f} holds, {observed.grows:.4f} grows | |")


def overlay(drive: Drive, runs: tuple[Recording, ...]) -> None:
    """Draw the four real P-control recordings over their predictions."""
    from baselines.report.control_plots import plot_overlay

    real = sorted(
        (r for r in runs if r.closed_loop), key=lambda r: (r.excitation.feedback == "x1", r.excitation.gain or 0.0)
    )
    pairs = [(r, simulate_like(drive, r)) for r in real]
    print(
        "\n| recording | rms x2, measured - predicted [mm] | grows: measured, predicted | sensor faults |\n|---|---|---|---|"
    )
    for measured, simulated in pairs:
        keep = measured.valid("x2")
        off = float(np.sqrt(np.mean((measured.x2 - simulated.x2)[keep] ** 2)))
        predicted = replace(simulated, excitation=measured.excitation, xr=measured.xr)
        said = ["grows" if grows(r) else "holds" for r in (measured, predicted)]
        faults = ", ".join(
            f"{f.where} {f.id} {f.start_s:.2f}–{f.end_s:.2f} s" for f in measured.faults if f.id != "saturation"
        )
        print(f"| {measured.name} | {off:.2f} | {said[0]}, {said[1]} | {faults or 'none'} |")
    save_png(plot_overlay(pairs), ROOT / "docs" / "p_control_overlay.png", 110)
    print("wrote docs/p_control_overlay.png")

"""The page of ``flexdrive blind``."""

from __future__ import annotations

from collections.abc import Sequence

from baselines.blind_study.judge import Judged
from baselines.blind_study.payoff_summary import Row, tables
from baselines.blind_study.summary import Summary, headline, missed_or_false
from baselines.evaluation.proportions import Share
from baselines.report import trial_plots as plots
from baselines.report.page import Section, render
from flexdrive_gym import __version__


def build_trial_page(
    summary: Summary, trials: Sequence[Judged], paid: Sequence[Row] = (), *, command: str, engine: str
) -> str:
    """Return the page as HTML: aims, confusion, detection limits, misses, parameters, closed loops, every trial."""
    sections = [
        _aims(summary),
        _confusion(summary),
        _detection(summary),
        _missed_or_false(trials),
        _worth(summary, trials),
        _loops(paid),
        _all(trials),
    ]
    return render(
        title="Concealed trial of the diagnosis",
        subtitle=f"{summary.trials} data sets of rigs simulated by an independent program; truths sealed before the diagnosis",
        summary=_sentences(summary),
        sections=[s for s in sections if s.blocks],
        footer=f"Made by flexdrive {__version__}, code {engine}: {command}.",
    )


def _sentences(summary: Summary) -> list[str]:
    said = []
    if summary.named is not None and summary.exact is not None:
        said.append(
            f"Of single effects at half the plainly present size and above, {summary.named.value:.0%} are named "
            f"({summary.exact.value:.0%} exactly, the others in a tie)."
        )
    if summary.null_names is not None and summary.false_names is not None:
        said.append(
            f"Where nothing is concealed, {summary.null_names.hits} of {summary.null_names.trials} diagnoses give a name; "
            f"{summary.false_names.value:.0%} of all trials have a false positive."
        )
    if summary.outside_unnamed is not None:
        said.append(f"Effects outside the catalogue are reported as unnamed in {summary.outside_unnamed}.")
    return said


def _aims(summary: Summary) -> Section:
    section = Section("Figures", "figures")
    section.table(("", "value (95 % interval)", "aim"), headline(summary))
    section.table(
        ("size of a single effect", "named exactly or in a tie"),
        [(f"{size:g}", str(named)) for size, named in summary.by_size.items()],
    )
    return section


def _confusion(summary: Summary) -> Section:
    section = Section("Confusion matrix", "confusion")
    if summary.confusion:
        section.figure(plots.plot_confusion(summary), "Number of trials; a pair counts once for each of its effects.")
    return section


def _detection(summary: Summary) -> Section:
    section = Section("Detection limits", "detection")
    if summary.detection:
        section.figure(
            plots.plot_detection(summary),
            "Logistic curves with a common slope. With few trials an effect's limit depends on those of the others.",
        )
    return section


def _missed_or_false(trials: Sequence[Judged]) -> Section:
    section = Section("Missed or false", "missed")
    if found := missed_or_false(trials):
        section.table(("trial", "concealed", "found", "wrong"), found)
    return section


def _worth(summary: Summary, trials: Sequence[Judged]) -> Section:
    section = Section("Predictions and parameters", "worth")
    section.figure(
        plots.plot_gains(trials),
        "Left: error of the critical gain from x2 that each drive predicts. Right: rms on held-out recordings over "
        "the floor.",
    )
    section.table(
        ("parameter", "median relative error", "truth inside the 95 % interval"),
        [(a.name, f"{a.median_error:.1%}", _share(a.inside)) for a in (*summary.base, *summary.effects)],
    )
    return section


def _loops(paid: Sequence[Row]) -> Section:
    section = Section("Closed loops on the concealed rigs", "loops")
    if paid:
        section.text(
            "Controllers designed on the handout's tied fit, on the free fit and on the diagnosed drive, each run on the "
            "concealed rig under the same nuisance, three times the handout's trajectory of 8 s. Ratios are paired by rig; below "
            "1 the design on the diagnosed drive tracks better. Iterative learning control takes its command from simulations of "
            "the drive with all its named physics. Stability is that of the rig with dry friction. Margins are those without it, "
            "except of P-control, whose critical gain depends on friction."
        )
        for columns, rows in tables(paid):
            section.table(columns, rows)
    return section


def _share(share: Share | None) -> str:
    return "–" if share is None else str(share)


def _all(trials: Sequence[Judged]) -> Section:
    section = Section("Every trial", "trials", folded=True)
    section.table(
        ("trial", "kind", "concealed", "found", "rms held out, before → after (floor) [mm/s]", "faults", "time [s]"),
        [
            (
                str(t.number),
                t.kind,
                t.truth,
                t.answer,
                f"{t.before:.2f} → {t.after:.2f} ({t.floor:.2f})",
                f"{t.faults_found} of {t.faults}" if t.faults else "–",
                f"{t.seconds:.0f}",
            )
            for t in trials
        ],
    )
    return section

"""The part of the comparison's page about learnt policies: intervals, probabilities of improvement, where they lose and why."""

from __future__ import annotations

from collections.abc import Sequence

from baselines.compare import Behaviour, Comparison, Improvement, Summary, learnt_verdicts, where_it_loses
from baselines.compare.cases import HANDOUT
from baselines.report import learnt_plots as plots
from baselines.report.design_page import cell
from baselines.report.page import Section
from flexdrive_gym.units import in_rig_units


def statistics_section(
    comparison: Comparison, summaries: Sequence[Summary], improvements: Sequence[Improvement]
) -> Section:
    """Return interquartile means with intervals of all groups, and the probability of improvement of the learnt ones."""
    units = comparison.drive.units
    section = Section("Statistics", "statistics", units=units)
    section.items(learnt_verdicts(comparison, summaries, improvements))
    summaries = in_rig_units(summaries, units)
    section.figure(
        plots.plot_intervals(comparison, summaries),
        "Interquartile mean (stroke) and 95 % interval (bar) over training seeds and drives; learnt policies in red.",
    )
    drawn = len(comparison.where())
    section.heading(f"Handout's trajectory on {drawn} {'drives' if drawn > 1 else 'drive'}, interquartile means")
    section.table(
        ("group", "seeds", "rms e [mm]", "vibration [V mm]", "rms u [V]", "failures", "rms e with effects [mm]", "failures"),
        [
            (s.name, str(s.seeds), str(s.rms), str(s.vibration), str(s.effort), s.failures.percent, str(s.effects),
             s.effect_failures.percent)
            for s in summaries
        ],
    )  # fmt: skip
    if comparison.references:
        section.heading("Other references, interquartile mean of rms [mm]")
        section.table(
            ("group", *comparison.references),
            [(s.name, *(str(s.unseen[name]) for name in comparison.references)) for s in summaries],
        )
    for name in dict.fromkeys(i.learnt for i in improvements):
        section.heading(f"Probability that {name} is better on the same drive")
        section.table(
            ("against", "rms", "vibration", "rms u", "rms with effects", "rms along other references"),
            [
                (i.classical, *(e.percent for e in (i.rms, i.vibration, i.effort, i.effects, i.unseen)))
                for i in improvements
                if i.learnt == name
            ],
        )
    section.text(
        "Interquartile mean, bootstrap intervals and probability of improvement as in Agarwal et al. (NeurIPS 2021). A trained "
        "agent meets all drives, so whole agents are resampled, and drives apart from them; five seeds are few, and their "
        "intervals rather too narrow. 50 % is no difference."
    )
    if any(s.name.endswith("+preview") for s in summaries):
        section.text(
            "Learnt policies see the reference ahead, which no design of the handout does. What is named +preview is the same "
            "design with a fixed preview of the reference, tuned along random moves."
        )
    return section


def behaviour_section(comparison: Comparison, summaries: Sequence[Summary], found: Behaviour) -> Section:
    """Return where learnt policies lose and why: responses, equivalent gain and phase, margins by trial."""
    units = comparison.drive.units
    section = Section("Where learning loses, and why", "losses", units=units)
    section.items(where_it_loses(comparison, summaries, found))
    found = in_rig_units(found, units)
    section.figure(plots.plot_responses(found, HANDOUT, units), "Handout's trajectory on the identified drive.")
    other = _hardest(comparison, summaries)
    if other is not None:
        section.figure(
            plots.plot_responses(found, other, units),
            f"The reference {other} on the identified drive: the one along which learnt policies are worst beside the best "
            "classical design.",
        )
    section.figure(
        plots.plot_sweeps(found, units),
        "Describing functions: what each policy makes of a sine of tracking error, at its amplitude, and Lab 4's known response.",
    )
    section.heading("Margins of the shown controllers")
    swept = [s for s in found.shown if s.sweep is not None]
    amplitudes = tuple(float(a) for a in max((s.sweep.amplitudes for s in swept if s.sweep is not None), key=len))
    rows = []
    for s in found.shown:
        trial = s.result.on_rig
        by_trial = ("–", "–") if trial is None else (cell(trial.gain_margin, 4), cell(1e3 * trial.delay_margin, 4))
        predicted = [cell(value, 3) for value in s.predicted]
        rows.append((s.name, *by_trial, *predicted, *["–"] * (len(amplitudes) - len(predicted))))
    section.table(
        (
            "controller",
            "GM with friction",
            "delay with friction [ms]",
            *(f"GM by the sweep, {a:.3g} {units.length}" for a in amplitudes),
        ),
        rows,
    )
    section.text(
        "On the rig: with friction, counts and limit; a dash where 200 times the gain, or a second of delay, does not fail it, "
        "or where it fails as it is. By the sweep: the equivalent loop on the drive without friction."
    )
    return section


def _hardest(comparison: Comparison, summaries: Sequence[Summary]) -> str | None:
    """Return the other reference along which learnt groups lose most, or win least."""
    learnt = {g.name for g in comparison.groups if g.learnt}

    def ratio(name: str) -> float:
        ours, theirs = (
            [s.unseen[name].value for s in summaries if (s.name in learnt) is wanted] for wanted in (True, False)
        )
        return min(ours) / min(theirs) if theirs else min(ours)

    return max(comparison.references, key=ratio, default=None)

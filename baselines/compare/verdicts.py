"""Where learning wins and where it loses, in sentences made from the figures; no claim is fixed."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

import numpy as np

from baselines.compare.behaviour import Behaviour, Shown, best_classical
from baselines.compare.cases import HANDOUT
from baselines.compare.result import Group, Result
from baselines.compare.results import Comparison
from baselines.compare.summary import Improvement, Summary
from baselines.loop_analysis.describing_function import analytic_response
from flexdrive_gym import LinearController
from flexdrive_gym.units import Units, in_rig_units

# what the project asks of an agent that reads x2: at most half of the error of P-control from x2
AIM = 0.5
# more effects than these are counted
_NAMED = 6
_AIM_OF, _AIM_AGAINST = "rl_x2", "p_x2"


def learnt_verdicts(
    comparison: Comparison, summaries: Sequence[Summary], improvements: Sequence[Improvement]
) -> list[str]:
    """Say of every learnt group how it stands against the classical designs, with intervals, in the rig's units."""
    units = comparison.drive.units
    summaries = in_rig_units(summaries, units)
    by_name = {s.name: s for s in summaries}
    said = []
    for group in (g for g in comparison.groups if g.learnt):
        own = by_name[group.name]
        said.append(
            f"{group.name} ({_seeds(own.seeds)}): interquartile mean of the rms error over {_drives(comparison)} "
            f"{own.rms} {units.length}, {own.failures.value:.0%} of the runs fail."
        )
        p = by_name.get(_AIM_AGAINST)
        if p is not None and group.name == _AIM_OF and p.rms.value > 0.0:
            ratio = own.rms.value / p.rms.value
            word = "meets" if ratio <= AIM else "misses"
            said.append(
                f"That is {ratio:.0%} of {p.name}'s {p.rms.value:.3g} {units.length}: it {word} the aim of {AIM:.0%}."
            )
        said += _standing(group.name, [i for i in improvements if i.learnt == group.name])
        said += _same_period(comparison, group, by_name)
    return said


def _seeds(n: int) -> str:
    return "one training seed" if n == 1 else f"{n} training seeds"


def _drives(comparison: Comparison) -> str:
    drawn = len(comparison.where())
    return "the identified drive" if drawn == 1 else f"{drawn} drawn drives"


def _standing(name: str, pairs: Sequence[Improvement]) -> list[str]:
    """Sort the classical designs by whether they are beaten for certain, on the same drives."""
    wins = [i.classical for i in pairs if i.rms.low > 0.5]
    losses = [i.classical for i in pairs if i.rms.high < 0.5]
    open_ = [i.classical for i in pairs if i.rms.low <= 0.5 <= i.rms.high]
    said = []
    if wins:
        better = ", ".join(wins) if len(wins) <= _NAMED else f"{len(wins)} of {len(pairs)} designs"
        said.append(f"On the same drives {name} tracks better than {better}.")
    if losses:
        said.append(f"It loses against {', '.join(losses)}.")
    if open_:
        said.append(
            f"No difference from {', '.join(open_)} is significant (the interval of the probability of improvement "
            "contains 50 %)."
        )
    return said


def _same_period(comparison: Comparison, group: Group, by_name: dict[str, Summary]) -> list[str]:
    """Hold the group against what classical designs keep at its own sample time."""
    entry = group.results[0].entry
    candidates = [
        g
        for g in comparison.groups
        if not g.learnt
        and abs(g.results[0].entry.period - entry.period) < 1e-9
        and g.results[0].entry.feedback == entry.feedback
        and g.results[0].nominal.success
    ]
    if not candidates or entry.period == 1e-3:
        return []
    best = min(candidates, key=lambda g: by_name[g.name].rms.value)
    sentence = (
        f"At the same {1e3 * entry.period:g} ms and from the same encoder the best classical design is {best.name}, "
        f"{by_name[best.name].rms} {comparison.drive.units.length}."
    )
    return [sentence]


def where_it_loses(comparison: Comparison, summaries: Sequence[Summary], found: Behaviour) -> list[str]:
    """Say along which references and with which effects learnt groups lose, and what their behaviour shows of the reason.

    All are given in the engine's units and told in the rig's.
    """
    units = comparison.drive.units
    comparison, found = in_rig_units(comparison, units), in_rig_units(found, units)
    summaries, mm = in_rig_units(summaries, units), units.length
    by_name = {s.name: s for s in summaries}
    said = []
    for group in (g for g in comparison.groups if g.learnt):
        classical = best_classical(comparison, group.results[0].entry.feedback)
        if classical is None:
            continue
        own, other = by_name[group.name], by_name[classical.entry.group or classical.entry.name]
        pairs = [(HANDOUT, own.rms.value, other.rms.value)]
        pairs += [(name, own.unseen[name].value, other.unseen[name].value) for name in own.unseen]
        lost = sorted(((a / b, name, a, b) for name, a, b in pairs if a > b > 0.0), reverse=True)
        won = [f"{name} ({a:.3g} against {b:.3g} {mm})" for name, a, b in pairs if a <= b]
        if lost:
            said.append(
                f"{group.name} loses against {classical.entry.name}, the best classical design from the same encoder, "
                "along "
                + ", ".join(f"{name} ({a:.3g} against {b:.3g} {mm})" for _ratio, name, a, b in lost)
                + (f"; it wins along {', '.join(won)}." if won else "; it wins along none.")
            )
        else:
            said.append(
                f"{group.name} has less error than {classical.entry.name}, the best classical design from the same encoder, "
                f"along every reference: {', '.join(won)}."
            )
        said += _price(group, classical, own, other, units)
        said += _lost_effects(group, classical.entry.name, comparison)
        shown, theirs = found.find(group.middle.entry.name), found.find(classical.entry.name)
        if shown is not None and theirs is not None:
            said += _why(shown, theirs, found, comparison, units)
    return said


def _lost_effects(group: Group, classical: str, comparison: Comparison) -> list[str]:
    """Name the left-out effects with which most seeds fail and the classical design does not."""
    theirs = next(r for r in comparison.results if r.entry.name == classical).effects
    lost = [
        name
        for name, of in theirs.items()
        if of.success and np.mean([r.effects[name].success for r in group.results]) < 0.5
    ]
    if not theirs:
        return []
    if not lost:
        return [f"There is no left-out effect with which {classical} settles and most seeds of {group.name} do not."]
    if len(lost) > _NAMED:
        most = f"{'; '.join(lost[:_NAMED])} and {len(lost) - _NAMED} more of {len(theirs)} left-out effects"
        return [f"With {most} most seeds of {group.name} fail where {classical} settles."]
    return [f"With {'; '.join(lost)} most seeds of {group.name} fail where {classical} settles."]


def _why(shown: Shown, classical: Shown, found: Behaviour, comparison: Comparison, units: Units) -> list[str]:
    """Say what the runs and the sweep show: error of moves or rests, equivalent gain at rest, margins."""
    said = []
    mm, per_mm = units.length, units.name("V/mm")
    ours, theirs = shown.parts[HANDOUT], classical.parts[HANDOUT]
    if isfinite(ours.resting) and isfinite(theirs.resting):
        said.append(
            f"Along the handout's trajectory {shown.name} (the middle seed) errs by {ours.moving:.3g} {mm} rms in the moves "
            f"and {ours.resting:.3g} {mm} in the rests, {classical.name} by {theirs.moving:.3g} and {theirs.resting:.3g} {mm}; "
            f"at the end of the rests {ours.offset:.3g} {mm} are left, of {classical.name} {theirs.offset:.3g} {mm}."
        )
    lab4 = found.find("lab4")
    if shown.sweep is not None and lab4 is not None and isinstance(lab4.result.entry.controller, LinearController):
        slow = float(shown.sweep.frequencies[0])
        gains = np.abs(shown.sweep.response[:, 0])
        reference = abs(analytic_response(lab4.result.entry.controller, "x2", [slow * units.one("Hz")])[0]) / units.one(
            "V/mm"
        )
        friction = comparison.drive["d1"] + comparison.drive["d2"]
        low, high = float(np.min(gains)), float(np.max(gains))
        span = f"{low:.2g} {per_mm}" if high < 1.05 * low else f"{low:.2g} … {high:.2g} {per_mm} over amplitudes"
        small = shown.sweep.amplitudes[0]
        answer = float(gains[0]) * small
        said.append(
            f"At {slow:g} Hz its equivalent gain is {span}, Lab 4's {reference:.2g} {per_mm} (integral action). A slow error of "
            f"{small:.3g} {mm} draws {answer:.3g} {units.command} from it; the carts' dry friction is {friction:.3g} "
            f"{units.command}, so "
            + (
                "it moves them out of such an error."
                if answer > friction
                else "such an error is left where the carts stand."
            )
        )
    return said


def _price(group: Group, classical: Result, own: Summary, other: Summary, units: Units) -> list[str]:
    """Hold vibration, effort and margins on the rig against the classical design's; margins are the median over seeds."""
    pairs = [
        ("vibration in the rests", units.name("V mm"), own.vibration.value, other.vibration.value, True),
        ("rms of the command", units.command, own.effort.value, other.effort.value, True),
    ]
    trials = [r.on_rig for r in group.results if r.on_rig is not None]
    if trials and classical.on_rig is not None:
        gain, delay = (float(np.median([getattr(t, f"{x}_margin") for t in trials])) for x in ("gain", "delay"))
        pairs += [
            ("gain margin with friction", "", gain, classical.on_rig.gain_margin, False),
            ("delay margin with friction", "ms", 1e3 * delay, 1e3 * classical.on_rig.delay_margin, False),
        ]
    told: dict[bool, list[str]] = {True: [], False: []}
    for name, unit, a, b, less_is_better in pairs:
        # what differs by less than 2 % is alike
        if a == b or abs(a - b) <= 0.02 * max(abs(a), abs(b)):
            continue
        text = f"{name} ({_figure(a)} against {_figure(b)}{' ' + unit if unit else ''})"
        told[(a < b) is less_is_better].append(text)
    said = []
    if told[False]:
        said.append(f"Beside {classical.entry.name}, {group.name} is worse in {', '.join(told[False])}.")
    if told[True]:
        said.append(f"Beside {classical.entry.name}, {group.name} is better in {', '.join(told[True])}.")
    failing = [r.entry.name for r in group.results if r.on_rig is None]
    if failing and trials:
        said.append(f"As they are, {', '.join(failing)} fail the simulated trial with friction: they have no margin.")
    return said + _seeds_differ(group, units)


def _seeds_differ(group: Group, units: Units) -> list[str]:
    """Say how far apart the seeds are."""
    if len(group.results) < 2:
        return []
    said = []
    for name, unit, words in (("rms", "mm", "rms error"), ("vibration", "V mm", "vibration in the rests")):
        ranked = sorted(group.results, key=lambda r: getattr(r.nominal, name))
        low, high = ranked[0], ranked[-1]
        said.append(
            f"{words} from {_figure(getattr(low.nominal, name))} ({low.entry.name}) to "
            f"{_figure(getattr(high.nominal, name))} {units.name(unit)} ({high.entry.name})"
        )
    return [f"Its seeds differ on the identified drive: {'; '.join(said)}."]


def _figure(value: float) -> str:
    return f"{value:.3g}" if isfinite(value) else "no limit"

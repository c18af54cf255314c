"""The page of ``flexdrive term``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from baselines.report import term_plots as plots
from baselines.report import words
from baselines.report.page import Section, render
from baselines.term.groups import Group
from baselines.term.outliers import listed
from baselines.term.plan import measured
from baselines.term.random_effects import MOST, Spread
from baselines.term.summary import Term
from flexdrive_gym import __version__

_KINDS = {
    "copy": "equal recordings",
    "sign": "wrong sign",
    "encoder": "failing encoder",
    "parameter": "parameter",
    "fit": "fit",
}
_BETWEEN = {
    "rig": "between rigs",
    "session": "between sessions of a rig",
    "run": "between runs of a session",
}
Row = Mapping[str, Any]
_SHORT = 24


def build_term_page(term: Term, *, title: str) -> str:
    """Return the page as HTML: who stands out, every group in a row, parameters, gains, what differs, what changed."""
    sections = [
        _outliers(term),
        _changes(term),
        _groups(term),
        _parameters(term),
        _gains(term),
        _spreads(term),
        _findings(term),
        _faults(term),
        _remarks(term),
        _costs(term),
    ]
    return render(
        title=title,
        subtitle=_subtitle(term),
        summary=_sentences(term),
        sections=[s for s in sections if s.blocks],
        footer=f"Made by flexdrive {__version__}.",
    )


def _subtitle(term: Term) -> str:
    count = sum(r.get("recordings", 0) for r in term.rows)
    terms = f"{len(term.terms)} terms, " if len(term.terms) > 1 else ""
    return f"{terms}{len(term.groups)} groups, {count} recordings"


def _sentences(term: Term) -> list[str]:
    skipped = [g.label for g, r in zip(term.groups, term.rows, strict=True) if r["status"] != "ok"]
    lines = [f"{len(term.usable)} of {len(term.groups)} groups were identified."]
    if skipped:
        lines.append(f"Not examined, each with its reason below: {listed(skipped, 6)}.")
    strange = list(dict.fromkeys(o.group for o in term.outliers))
    lines.append(
        f"{'One stands' if len(strange) == 1 else f'{len(strange)} stand'} out: {listed(strange, 6)}."
        if strange
        else "Nobody stands out."
    )
    changed = [c for c in term.changes if c.significant]
    if term.changes:
        first = sorted(changed, key=lambda c: c.p_value)[:3]
        more = f" ({len(changed)} changes in all)" if len(changed) > 3 else ""
        text = "; ".join(c.sentence() for c in first) or "no parameter changed significantly since the term before"
        lines.append(f"{text[0].upper()}{text[1:]}{more}.")
    return lines


def _outliers(term: Term) -> Section:
    section = Section("Outliers", "outliers")
    if term.outliers:
        section.table(
            ("group", "what", "why"),
            [(o.group.replace(" ", "\u00a0"), _KINDS[o.kind], o.sentence) for o in term.outliers],
        )
        section.text(
            "A parameter is an outlier if it differs significantly from what the other rigs predict by mean and spread: 5 % over "
            "all groups and parameters."
        )
    return section


def _groups(term: Term) -> Section:
    section = Section("Groups", "groups")
    diagnosed = any("verdict" in r for r in term.rows)
    columns = [
        "group",
        "recordings",
        "says",
        *(["left out of the model"] if diagnosed else []),
        "faults",
        f"gain from x2 [{_gain_unit(term)}]",
        "on the rig",
    ]
    section.table(columns, [_group(g, r, diagnosed) for g, r in zip(term.groups, term.rows, strict=True)])
    return section


def _group(group: Group, row: Row, diagnosed: bool) -> tuple[str, ...]:
    if row["status"] != "ok":
        rest = ("",) * (4 if diagnosed else 3)
        return (_label(group), str(row.get("recordings", "")), f"not examined: {row['reason']}", *rest)
    verdict = [_named(row)] if diagnosed else []
    faulty = len({f["recording"] for f in row["faults"]})
    predicted = row["critical_gain"]["predicted"].get("critical_gain_x2_trajectory")
    return (
        _label(group),
        str(row["recordings"]),
        _readiness(row),
        *verdict,
        f"in {faulty} recordings" if faulty else "none",
        _estimate(predicted),
        _reached(row),
    )


def _gain_unit(term: Term) -> str:
    gains = [p for _, r in term.usable for p in r["critical_gain"]["predicted"].values()]
    return next((p["unit"] for p in gains), "V/mm")


def _readiness(row: Row) -> str:
    """Return in a few words whether the recordings suffice; a finished check says more."""
    line: str = row.get("line", "identified")
    ready, _, rest = line.partition(": ")
    return (
        f"ready; {rest.split('; ')[-1]}"
        if ready == "ready" and "not determined" in rest
        else ready
        if ready == "ready"
        else line
    )


def _label(group: Group) -> str:
    """Return a group's name that stays on one line where it is short."""
    return group.label.replace(" ", "\u00a0") if len(group.label) <= _SHORT else group.label


def _named(row: Row) -> str:
    if "verdict" not in row:
        return "not diagnosed"
    names = [f"{words.effect_name(f['id'])} at {f['where'].replace('_', ' ')}" for f in row["findings"]]
    if row.get("unnamed"):
        names.append(f"something without a name on {row['unnamed']['where'].replace('_', ' ')}")
    return ", ".join(names) or row["verdict"].replace("_", " ")


def _estimate(found: Mapping[str, Any] | None) -> str:
    if found is None or found["value"] is None:
        return "–"
    interval = found["ci95"]
    bounds = "" if interval is None or None in interval else f" [{interval[0]:.3g}, {interval[1]:.3g}]"
    return f"{found['value']:.3g}{bounds}"


def _reached(row: Row) -> str:
    reached = row["critical_gain"]["reached"]
    parts = [
        f"{reached[key]:.4g} {said}" for key, said in (("holds", "held"), ("grows", "grew")) if reached[key] is not None
    ]
    return ", ".join(parts) or "–"


def _parameters(term: Term) -> Section:
    section = Section("Parameters", "parameters")
    if not term.usable:
        return section
    section.figure(
        plots.plot_parameters(term),
        "Parameters of the base model of every group, with 95 % intervals from the spread between runs; red squares stand out.",
    )
    names = list(dict.fromkeys(n for _, r in term.usable for n in r["parameters"]))
    units = {n: next(r["parameters"][n]["unit"] for _, r in term.usable if n in r["parameters"]) for n in names}
    section.table(
        ("group", *(f"{n} [{units[n]}]" for n in names)),
        [(_label(g), *(_estimate(r["parameters"].get(n)) for n in names)) for g, r in term.usable],
        folded="Values",
    )
    return section


def _gains(term: Term) -> Section:
    section = Section("Critical gains", "gains")
    if any(r["critical_gain"]["predicted"].get("critical_gain_x2_trajectory") for _, r in term.usable):
        section.figure(
            plots.plot_gains(term),
            "Gain from x2 at which the lab's trajectory begins to grow: predicted for another run of the rig, that of the "
            "linear loop, and the gains that held and grew in the recordings.",
        )
    return section


def _spreads(term: Term) -> Section:
    section = Section("What differs between rigs, sessions and runs", "spreads")
    if not term.spreads:
        return section
    section.figure(
        plots.plot_spreads(term.spreads),
        "Standard deviation of each parameter, in per cent of its value, jointly estimated (REML); bars: 95 %.",
    )
    for level, text in _BETWEEN.items():
        own = sorted((s for s in term.spreads if s.level == level), key=lambda s: -s.value)
        if own:
            most = ", ".join(f"{s.parameter} {s.value:.0%} [{s.ci95[0]:.0%}, {_upper(s)}]" for s in own[:3])
            section.text(f"Most {text}: {most}.")
    section.text(
        "Masses and springs do not differ between runs: where theirs do here, the base model lacks something that runs differ by."
    )
    levels = {s.level for s in term.spreads}
    missing = [text for level, text in _BETWEEN.items() if level not in levels]
    if missing:
        section.text(f"Nothing can be said of what differs {' or '.join(missing)}: there is one in each.")
    return section


def _upper(spread: Spread) -> str:
    """Return the upper end of an interval, which few units leave open."""
    return f"{spread.ci95[1]:.0%}" if spread.ci95[1] < MOST else "open"


def _changes(term: Term) -> Section:
    section = Section("Since the term before", "changes")
    if term.changes:
        section.figure(plots.plot_changes(term), "Change of every parameter of every rig that is in both terms.")
        section.items(
            [f"{c.sentence()}." for c in term.changes if c.significant] or ["No parameter changed significantly."]
        )
    return section


def _findings(term: Term) -> Section:
    section = Section("Findings", "findings", folded=True)
    rows = [(_label(g), f["statement"]) for g, r in term.usable for f in r.get("findings", ())]
    if rows:
        section.table(("group", "finding"), rows)
    return section


def _faults(term: Term) -> Section:
    section = Section("Faults", "faults", folded=True)
    rows = []
    for g, r in zip(term.groups, term.rows, strict=True):
        kinds: dict[tuple[str, str], list[str]] = {}
        for f in r.get("faults", ()):
            kinds.setdefault((f["where"], f["id"]), []).append(f["recording"])
        for (where, fault), names in kinds.items():
            rows.append(
                (_label(g), where.replace("_", " "), fault.replace("_", " "), listed(list(dict.fromkeys(names))))
            )
    if rows:
        section.table(("group", "where", "fault", "recordings"), rows)
    return section


def _remarks(term: Term) -> Section:
    section = Section("Files left out, and remarks", "remarks", folded=True)
    rows = [
        (_label(g), text)
        for g, r in zip(term.groups, term.rows, strict=True)
        for text in (
            *(f"{s['file']}: {s['reason']}" for s in r.get("skipped", ())),
            *r.get("warnings", ()),
            *r["notes"],
        )
    ]
    if rows:
        section.table(("group", "remark"), rows)
    if term.notes:
        section.items(term.notes)
    return section


def _costs(term: Term) -> Section:
    section = Section("What it cost", "costs", folded=True)
    if term.usable:
        costs = measured(term.rows)
        slowest: Sequence[tuple[str, float]] = sorted(costs.steps.items(), key=lambda item: -item[1])
        section.text(
            f"{costs.seconds:.2g} s of one core a recording (at most {costs.most_seconds:.2g} s), {costs.peak_mb:.0f} MB a "
            f"worker, {1e3 * costs.mb_in:.0f} kB to a worker and {1e3 * costs.mb_out:.1f} kB back for a recording. Time: "
            f"{', '.join(f'{name} {share:.0%}' for name, share in slowest)}."
        )
    return section

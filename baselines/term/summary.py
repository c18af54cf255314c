"""A term at a glance: the rows of all groups, who stands out among them, what differs, and what changed since the term before."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from baselines.term.changes import Change, changes
from baselines.term.copies import Equal, equal_recordings, in_words
from baselines.term.evidence import RunEvidence
from baselines.term.groups import Group
from baselines.term.outliers import FIT, Outlier, apart, failing_encoders, listed
from baselines.term.outliers import in_words as apart_in_words
from baselines.term.random_effects import Spread, as_json, gathered, random_effects
from baselines.term.study import Row, clean

SCHEMA = 1
# of the rms residual's logarithm: errors of a run are correlated, so it is known to some per cent
_FIT_ERROR = 0.05
# of a row, what term.json tells
_TOLD = ("status", "reason", "recordings", "sessions", "units", "carts", "ready", "line", "parameters", "rms", "verdict",
         "findings", "unnamed", "faults", "signs", "critical_gain", "skipped", "notes", "cost")  # fmt: skip
# and what it tells of a group that was skipped before it was known
_NOTHING: Mapping[str, Any] = {"parameters": {}, "verdict": None, "findings": [], "faults": [], "critical_gain": None}


@dataclass(frozen=True, eq=False)
class Term:
    """Everything a page of a term shows.

    Attributes
    ----------
    groups, rows
        Who handed in, and what came of it.
    outliers
        Who stands out, copies first.
    equal
        Groups that share recordings.
    spreads
        What differs between rigs, sessions and runs.
    changes
        From each term to the next.
    notes
        Sentences a reader should see.
    """

    groups: tuple[Group, ...]
    rows: tuple[Row, ...]
    outliers: tuple[Outlier, ...]
    equal: tuple[Equal, ...]
    spreads: tuple[Spread, ...]
    changes: tuple[Change, ...]
    notes: tuple[str, ...]

    @property
    def terms(self) -> tuple[str, ...]:
        """Names of the terms, in order; one empty name where there is only one."""
        return tuple(dict.fromkeys(g.term for g in self.groups))

    @property
    def usable(self) -> list[tuple[Group, Row]]:
        """Groups whose drive was identified."""
        return [(g, r) for g, r in zip(self.groups, self.rows, strict=True) if r["status"] == "ok"]

    def as_json(self) -> dict[str, Any]:
        """Return the object of ``term.json``."""
        told: dict[str, Any] = clean({
            "schema": SCHEMA,
            "groups": [
                {"name": g.name, "term": g.term, **_NOTHING, **{k: r[k] for k in _TOLD if k in r}}
                for g, r in zip(self.groups, self.rows, strict=True)
            ],
            "outliers": [asdict(o) for o in self.outliers],
            "equal_recordings": [asdict(e) for e in self.equal],
            "random_effects": as_json(self.spreads),
            "changes": [asdict(c) | {"sentence": c.sentence()} for c in self.changes],
            "notes": list(self.notes),
        })  # fmt: skip
        return told


def summarise(groups: Sequence[Group], rows: Sequence[Row], notes: Iterable[str] = ()) -> Term:
    """Compare what was found of all groups.

    Parameters
    ----------
    groups, rows
        In the same order.
    notes
        What is known already.
    """
    said = list(notes)
    pairs = list(zip(groups, rows, strict=True))
    equal = equal_recordings({g.label: r["fingerprints"] for g, r in pairs if "fingerprints" in r})
    copied = _copiers(equal, pairs)
    known = [(g, r) for g, r in pairs if r["status"] == "ok"]
    own = [(g, r) for g, r in known if g.label not in copied]
    comparable, why = _comparable(own)
    said += why
    outliers = [*_copies(equal, copied), *_signs(pairs), *_encoders(own), *_apart(comparable)]
    if 0 < len(comparable) < 5:
        said.append(f"with {len(comparable)} groups to compare nothing can be called unusual; it takes five")
    return Term(
        tuple(groups),
        tuple(rows),
        tuple(outliers),
        equal,
        _spreads(comparable, said),
        _changes(comparable),
        tuple(said),
    )


def _comparable(rows: Sequence[tuple[Group, Row]]) -> tuple[list[tuple[Group, Row]], list[str]]:
    """Return the groups that can be compared: those of the most frequent kind of rig."""
    kinds = Counter((r["carts"], r["units"]["length"], r["units"]["command"]) for _, r in rows)
    if len(kinds) < 2:
        return list(rows), []
    usual = kinds.most_common(1)[0][0]
    chosen = [(g, r) for g, r in rows if (r["carts"], r["units"]["length"], r["units"]["command"]) == usual]
    others = [g.label for g, r in rows if all(g is not c for c, _ in chosen)]
    return chosen, [f"{listed(others)} measure in other units or have another number of carts and are not compared"]


def _copiers(equal: Sequence[Equal], rows: Sequence[tuple[Group, Row]]) -> set[str]:
    """Return the groups most of whose recordings another one has as well: as a rig they count once."""
    counts = {g.label: r["recordings"] for g, r in rows if "recordings" in r}
    return {e.second for e in equal if 2 * len({b for _, b, _ in e.pairs}) > counts[e.second]}


def _copies(equal: Sequence[Equal], copied: Collection[str]) -> list[Outlier]:
    found = []
    for e in equal:
        names = listed([a if a == b else f"{b} ({a} there)" for a, b, _ in e.pairs])
        least = min(share for _, _, share in e.pairs)
        text = f"{len(e.pairs)} recordings equal those of {e.first}, {in_words(least)}: {names}"
        text += "; left out of the comparisons" if e.second in copied else ""
        found.append(Outlier(e.second, "copy", e.first, None, text))
    return found


def _signs(rows: Sequence[tuple[Group, Row]]) -> list[Outlier]:
    return [
        Outlier(g.label, "sign", s["where"], None, f"{s['sentence']} (seen in {s['recordings']} recordings)")
        for g, r in rows
        for s in r.get("signs", ())
    ]


def _encoders(rows: Sequence[tuple[Group, Row]]) -> list[Outlier]:
    table = {}
    for g, r in rows:
        places = ("encoder_1", "encoder_2")[: r["carts"]]
        table[g.label] = {
            where: (len({f["recording"] for f in r["faults"] if f["where"] == where}), r["recordings"])
            for where in places
        }
    return [
        Outlier(group, "encoder", where, p,
                f"{where.replace('_', ' ')} fails in {bad} of {n} recordings, more than the others' (p = {p:.1g}); look at its "
                "plug and its disc")
        for group, where, bad, n, p in failing_encoders(table)
    ]  # fmt: skip


def _apart(rows: Sequence[tuple[Group, Row]]) -> list[Outlier]:
    table = {g.label: {**_finite(r["parameters"]), FIT: {"value": r["rms"], "log_se": _FIT_ERROR}} for g, r in rows}
    return [
        Outlier(a.group, "fit" if a.parameter == FIT else "parameter", a.parameter, a.p_value, apart_in_words(a))
        for a in apart(table)
        if a.parameter != FIT or a.ratio > 1.0  # nobody complains of a model that fits too well
    ]


def _finite(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Return parameters with the infinities that JSON does not know."""
    return {
        name: {**p, "log_se": math.inf if p["log_se"] is None else p["log_se"], "degrees": p["degrees"] or math.inf}
        for name, p in parameters.items()
    }


def _spreads(rows: Sequence[tuple[Group, Row]], said: list[str]) -> tuple[Spread, ...]:
    told = [
        (g.name, g.term, r["evidence_of"], [RunEvidence.from_json(e) for e in r["evidence"]])
        for g, r in rows
        if r.get("evidence")
    ]
    if not told:
        return ()
    try:
        return random_effects(*gathered(told))
    except (ValueError, ArithmeticError) as error:
        said.append(f"what differs between rigs, sessions and runs could not be estimated: {error}")
        return ()


def _changes(rows: Sequence[tuple[Group, Row]]) -> tuple[Change, ...]:
    terms: dict[str, dict[str, Any]] = {}
    for g, r in rows:
        terms.setdefault(g.term, {})[g.name] = _finite(r["parameters"])
    return changes(terms) if len(terms) > 1 else ()

"""A diagnosis held against the documentation: named, tied or missed, and what else is claimed."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from baselines.real_rigs.entry import Documented, Effect, RealRig
from flexdrive_gym.drive.effects import EFFECTS

Json = Mapping[str, Any]


def judge(rig: RealRig, diagnosis: Json) -> dict[str, Any]:
    """Return what became of the concealed effects, and every claim beyond them.

    Parameters
    ----------
    rig
        Entry of the rig.
    diagnosis
        Object of ``diagnosis.json``.

    Returns
    -------
    dict
        ``concealed``: one row an effect, with ``outcome``, ``by`` and ``source``; ``claims``: one row a finding that stands for
        none of them, ``contradicted`` by the documentation or ``beyond`` it, with what would confirm it.
    """
    findings: Sequence[Json] = diagnosis["findings"]
    concealed = [_outcome(item, findings) for item in rig.concealed]
    documented = {name for item in rig.concealed for name in item.names}
    return {"concealed": concealed, "claims": claims(findings, documented, rig.denied)}


def claims(findings: Sequence[Json], documented: Collection[Effect], denied: Mapping[str, str]) -> list[dict[str, Any]]:
    """Return the findings that stand for nothing documented: a tie with something documented does."""
    rows = []
    for f in findings:
        if {_name(f), *map(_name, f["ties"])} & set(documented):
            continue
        reason = denied.get(f["id"])
        rows.append(
            {
                "id": f["id"],
                "where": f["where"],
                "ties": [{"id": t["id"], "where": t["where"]} for t in f["ties"]],
                "verdict": "contradicted" if reason else "beyond the documentation",
                "reason": reason,
                "confirm": _confirming(f["id"]),
            }
        )
    return rows


def _outcome(item: Documented, findings: Sequence[Json]) -> dict[str, Any]:
    row: dict[str, Any] = {"label": item.label, "source": item.source, "outcome": "missed", "by": None}
    for f in findings:
        if _name(f) in item.names:
            return {**row, "outcome": "tied" if f["ties"] else "named", "by": " at ".join(_name(f))}
    for f in findings:
        for tie in f["ties"]:
            if _name(tie) in item.names:
                return {**row, "outcome": "tied", "by": " at ".join(_name(f))}
    return row


def _name(item: Json) -> Effect:
    return item["id"], item["where"]


def _confirming(id_: str) -> str:
    """Return the experiment that would confirm an effect."""
    return next((e.separating_experiment or e.tells_itself_by for e in EFFECTS if e.id == id_), "")

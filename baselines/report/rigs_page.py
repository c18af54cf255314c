"""The page of ``flexdrive rigs``: the documented physics of real rigs, and the diagnosis without it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from baselines.report import words
from baselines.report.page import Section, render
from flexdrive_gym import __version__
from identification.mismatch.answer.finding import Unnamed

Row = Mapping[str, Any]
_MARKS = {"named": "✓ named", "tied": "≈ tied", "missed": "✗ missed"}


def build_rigs_page(found: Row, *, command: str) -> str:
    """Return the page as HTML.

    Parameters
    ----------
    found
        Object of ``rigs.json``.
    command
        That made it, for the footer.
    """
    examined = [r for r in found["rigs"] if r["status"] == "examined"]
    sections = [_rigs(found["rigs"]), _effects(examined), _claims(examined), _parameters(examined), _controls(examined)]
    return render(
        title="Real rigs: documented physics, concealed from the diagnosis",
        subtitle="Each rig's documented physics is left out of the base model and not given to the diagnosis.",
        summary=sentences(found),
        sections=[s for s in sections if s.blocks],
        footer=f"Made by flexdrive {__version__}: {command}.",
    )


def sentences(found: Row) -> list[str]:
    """Return the result in a few sentences."""
    told, aims = found["named"] + found["tied"], found["aims"]
    least, most = f" (aim: at least {aims['named_or_tied']})", f" (aim: at most {aims['contradicted_at_most']})"
    if found["concealed"] < aims["named_or_tied"]:
        # aims are of all rigs
        least = most = ""
    lines = [
        (
            f"{told} of {found['concealed']} documented effects are found: {found['named']} named, {found['tied']} tied with "
            f"look-alikes, {found['missed']} missed{least}."
        )
        if found["concealed"]
        else "No documented effect is concealed from the diagnosis here.",
        (
            f"{found['claims']} other claims: the documentation contradicts {found['contradicted']}{most}, the others lie beyond "
            "it."
        ),
    ]
    worse = [row["title"] for row in found["rigs"] if row["status"] == "examined" and _worse(row["errors"])]
    if worse:
        lines.append(f"With what is claimed the error grows on {', '.join(worse)}.")
    if any(row.get("control") for row in found["rigs"]):
        names = "name is" if found["control_claims"] == 1 else "names are"
        lines.append(f"With a look-alike's base model {found['control_claims']} {names} undocumented.")
    if found["absent"]:
        lines.append(f"Absent: {', '.join(found['absent'])}.")
    if found["failed"]:
        lines.append(f"Failed: {', '.join(found['failed'])}.")
    return lines


def overview(row: Row) -> tuple[str, ...]:
    """Return a rig's line of the first table: found, other claims, errors, seconds."""
    if row["status"] != "examined":
        return row["title"], f"{row['status']}: {row['reason']}", "", "", "", "", ""
    outcomes = [f"{_MARKS[c['outcome']]}: {c['label']}" for c in row["concealed"]]
    errors, rest = row["errors"], row["unnamed"]
    claims = [_claim(c) for c in row["claims"]]
    if rest is not None:
        claims.append(
            f"without a name: {words.without_name(Unnamed(rest['where'], rest['share_of_error'], rest['acts_on']))}"
        )
    return (
        row["title"],
        "; ".join(outcomes) or "nothing concealed",
        "; ".join(claims) or "none",
        f"{_number(errors['before'])} {errors['unit']}",
        _number(errors["after"]) + (" worse" if _worse(errors) else ""),
        _number(errors["floor"]),
        f"{row['seconds']:.0f}",
    )


def _worse(errors: Row) -> bool:
    before, after = errors["before"], errors["after"]
    return before is not None and after is not None and bool(after > before)


OVERVIEW = ("rig", "concealed", "also claimed", "error before", "after", "floor", "time [s]")


def _rigs(rows: Sequence[Row]) -> Section:
    section = Section("Rigs", "rigs")
    section.table(OVERVIEW, [overview(r) for r in rows])
    section.text(
        "Errors are rms on report recordings, opened when the names are final. The floor is what does not repeat."
    )
    return section


def _effects(rows: Sequence[Row]) -> Section:
    section = Section("Documented effects", "effects")
    lines = [
        (r["title"], c["label"], _MARKS[c["outcome"]], _words(c["by"]) if c["by"] else "–", c["source"])
        for r in rows
        for c in r["concealed"]
    ]
    if lines:
        section.table(("rig", "effect", "outcome", "by", "documented in"), lines)
    return section


def _claims(rows: Sequence[Row]) -> Section:
    section = Section("Claims beyond the documentation", "claims")
    lines = [
        (r["title"], _claim(c), c["verdict"] + (f": {c['reason']}" if c["reason"] else ""), c["confirm"])
        for r in rows
        for c in r["claims"]
    ]
    if lines:
        section.table(("rig", "claim", "documentation", "what would confirm it"), lines)
    return section


def _parameters(rows: Sequence[Row]) -> Section:
    section = Section("Parameters", "parameters")
    lines = [
        (
            r["title"],
            f"{p['label']} [{p['unit']}]",
            _number(p["documented"]),
            _number(p["found"]),
            f"{_number(p['ci95'][0])} … {_number(p['ci95'][1])}" if p["ci95"] else "–",
            "–" if p["deviation"] is None else f"{p['deviation']:+.0%}",
            p["source"],
        )
        for r in rows
        for p in r["parameters"]
    ]
    if lines:
        section.table(("rig", "parameter", "documented", "found", "95 % interval", "deviation", "documented in"), lines)
    return section


def _controls(rows: Sequence[Row]) -> Section:
    section = Section("Controls", "controls")
    lines = [
        (
            r["title"],
            r["control"]["base_model_of"],
            "; ".join(map(_words, r["control"]["named"])) or "nothing",
            "; ".join(_claim(c) for c in r["control"]["claims"]) or "nothing",
        )
        for r in rows
        if r["control"] is not None
    ]
    if lines:
        section.table(("rig", "base model of", "named", "not documented"), lines)
    return section


def _claim(claim: Row) -> str:
    ties = " or ".join(words.at(t["id"], t["where"]) for t in claim["ties"])
    return words.at(claim["id"], claim["where"]) + (f" (or {ties})" if ties else "")


def _words(name: str) -> str:
    return name.replace("_", " ")


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.3g}"

"""The terms of the pages, each explained once: on a page where it first occurs, and all of them in docs/glossary.md."""

from __future__ import annotations

import re
from dataclasses import dataclass
from html import escape
from textwrap import fill


@dataclass(frozen=True)
class Term:
    """A term: its anchor, what it looks like in a text (a regular expression), and what it means."""

    name: str
    found: str
    meaning: str

    @property
    def anchor(self) -> str:
        """Where the page explains it."""
        return "term-" + re.sub(r"[^a-z0-9]+", "-", self.name.lower()).strip("-")


TERMS = (
    Term(
        "describing function",
        r"describing functions?|harmonic balance",
        "The gain and phase of a nonlinear element for a sine of one amplitude, taken from the fundamental of"
        " its output. Harmonic balance predicts a steady vibration where this gain and phase close the loop "
        "exactly. Dry friction d at a velocity of amplitude V acts as a viscous damper 4d/(πV): the larger "
        "the vibration, the weaker the damping.",
    ),
    Term(
        "disk margin",
        r"[Dd]isk margins?|disk",
        "How much the gain and the phase of a loop may change at the same time and at any frequency before it"
        " becomes unstable: 0 is at the limit, 2 is the largest there is. With α the disk margin, the gain "
        "alone may change by the factor (2 + α)/(2 − α), the phase alone by 2·arctan(α/2).",
    ),
    Term(
        "delay margin",
        r"delay margins?",
        "The additional dead time at which a loop becomes unstable.",
    ),
    Term(
        "dwell",
        r"[Dd]wells?",
        "A stretch of a trajectory during which the reference rests, between two moves. There the "
        "steady-state error and the remaining vibration are read.",
    ),
    Term(
        "effective samples",
        r"effective samples|independent ones",
        "The number of independent samples with as much information as n autocorrelated residuals. The intervals "
        "are computed with it.",
    ),
    Term(
        "p-value",
        r"p-values?",
        "How often, at most, the best candidate of the whole catalogue predicts other recordings as well in data of "
        "this rig in which nothing is left out: in simulations of the model under unknown forces, run-to-run "
        "variability and encoder counts as large as the recordings show, and never less often than the best of so many "
        "likelihood ratios is as large by chance.",
    ),
    Term(
        "floor",
        r"[Ff]loor",
        "The rms of what differs between repetitions: between periods of one run and between runs of the same"
        " experiment. A model gives the same answer to the same command, so no model can leave less.",
    ),
    Term(
        "report recordings",
        r"[Rr]eport recordings?|[Hh]eld[ -]out",
        "Held out: used neither to fit nor to choose what is named. The error on them says whether the model "
        "describes the rig, or merely the recordings that it was fitted to (the estimation recordings).",
    ),
    Term(
        "interquartile mean",
        r"[Ii]nterquartile means?",
        "The mean of the middle half of all values. A few failed runs do not spoil it, as they do a mean, and"
        " it uses more of the values than a median.",
    ),
    Term(
        "NRMSE fit",
        r"NRMSE fit",
        "100 % · (1 − ‖y − ŷ‖ / ‖y − mean(y)‖): 100 % if the simulation ŷ is the measurement y, 0 % if it is "
        "no better than the mean of y, negative if it is worse.",
    ),
    Term(
        "presliding",
        r"[Pp]resliding",
        "What dry friction does before a cart slides: the contact yields elastically by micrometres to "
        "millimetres, like a stiff spring, until it breaks away at the Coulomb level. Ideal Coulomb friction "
        "has none.",
    ),
    Term(
        "restart",
        r"starting points?",
        "The likelihood has several minima. The fit is therefore begun from several points, and the best end "
        "is kept; another start that ended in a poorer minimum says nothing against it.",
    ),
    Term(
        "Routh",
        r"Routh",
        "Routh's criterion: the gain at which the characteristic polynomial of the linear closed loop has its"
        " first roots on the imaginary axis.",
    ),
    Term(
        "VAF",
        r"VAF",
        "Variance accounted for, 1 − var(y − ŷ)/var(y): 100 % if the simulation ŷ differs from the "
        "measurement y by a constant at most.",
    ),
)
_WORD = r"(?<![\w-])(?:{})(?![\w-])"
# what is not prose, or has a link already
_CLOSED = ("style", "script", "title", "h1", "h2", "h3", "summary", "a", "nav", "button")


def explained(page: str) -> str:
    """Return a page whose terms are linked where they first stand, with a section at its end that explains them.

    Parameters
    ----------
    page
        HTML with a ``<footer>``.
    """
    parts = re.split(r"(<[^>]*>)", page)
    open_: list[str] = []
    used: dict[str, Term] = {}
    for i, part in enumerate(parts):
        if part.startswith("<"):
            name = re.match(r"</?\s*(\w+)", part)
            if name is not None and name[1] in _CLOSED:
                if part.startswith("</"):
                    open_.remove(name[1])
                else:
                    open_.append(name[1])
        elif part.strip() and not open_:
            parts[i] = _linked(part, used)
    if not used:
        return page
    terms = sorted(used.values(), key=lambda t: t.name.lower())
    rows = "".join(f'<dt id="{t.anchor}">{escape(t.name)}</dt><dd>{escape(t.meaning)}</dd>' for t in terms)
    section = f'<h2 id="glossary">Terms used on this page</h2>\n<dl class="glossary">{rows}</dl>\n'
    return "".join(parts).replace("<footer>", section + "<footer>", 1)


def _linked(text: str, used: dict[str, Term]) -> str:
    """Return a text with the first mention of every term not used before as a link to its explanation."""
    places: list[tuple[int, int, Term]] = []
    for term in TERMS:
        if term.name in used:
            continue
        match = re.search(_WORD.format(term.found), text)
        if match is not None and all(match.end() <= a or b <= match.start() for a, b, _ in places):
            places.append((match.start(), match.end(), term))
            used[term.name] = term
    for begin, end, term in sorted(places, key=lambda place: -place[0]):
        link = f'<a class="term" href="#{term.anchor}" title="{escape(term.meaning)}">{text[begin:end]}</a>'
        text = text[:begin] + link + text[end:]
    return text


def markdown() -> str:
    """Return docs/glossary.md."""
    terms = sorted(TERMS, key=lambda t: t.name.lower())
    rows = "\n\n".join(fill(f"**{t.name}**: {t.meaning}", 138, break_on_hyphens=False) for t in terms)
    return (
        "# Glossary\n\nThe terms that the pages of `flexdrive` link where they first occur. The physical effects are in "
        f"[physics.md](physics.md).\n\n{rows}\n\nWritten by `python docs/glossary.py`.\n"
    )

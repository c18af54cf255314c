"""All controllers on the same drives, paired: what competes, where it runs, what is measured, and how sure that is."""

from baselines.compare.cases import DRAWS, UNSEEN, Case, cases_of, named_reference, typical_effects
from baselines.compare.comparison import DURATION_S, compare
from baselines.compare.entries import Entry, agent_entries, entries
from baselines.compare.results import Comparison, Group, Result
from baselines.compare.sentences import headline
from baselines.compare.summary import Improvement, Summary, summarise

__all__ = [
    "DRAWS",
    "DURATION_S",
    "UNSEEN",
    "Case",
    "Comparison",
    "Entry",
    "Group",
    "Improvement",
    "Result",
    "Summary",
    "agent_entries",
    "cases_of",
    "compare",
    "entries",
    "headline",
    "named_reference",
    "summarise",
    "typical_effects",
]

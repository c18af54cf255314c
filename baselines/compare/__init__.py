"""All controllers on the same drives, paired: what competes, where it runs, what is measured, and how sure that is."""

from baselines.compare.behaviour import Behaviour, behaviour, best_classical
from baselines.compare.cases import DRAWS, UNSEEN, Case, cases_of, named_reference, typical_effects
from baselines.compare.comparison import DURATION_S, compare
from baselines.compare.entries import Entry, agent_entries, entries, previewed_entries
from baselines.compare.own import is_own, load_linear, load_own, own_entry
from baselines.compare.result import Group, Result
from baselines.compare.results import Comparison
from baselines.compare.sentences import headline
from baselines.compare.shortlist import shortlist
from baselines.compare.summary import Improvement, Summary, summarise
from baselines.compare.verdicts import learnt_verdicts, where_it_loses

__all__ = [
    "DRAWS",
    "DURATION_S",
    "UNSEEN",
    "Behaviour",
    "Case",
    "Comparison",
    "Entry",
    "Group",
    "Improvement",
    "Result",
    "Summary",
    "agent_entries",
    "behaviour",
    "best_classical",
    "cases_of",
    "compare",
    "entries",
    "headline",
    "is_own",
    "learnt_verdicts",
    "load_linear",
    "load_own",
    "named_reference",
    "own_entry",
    "previewed_entries",
    "shortlist",
    "summarise",
    "typical_effects",
    "where_it_loses",
]

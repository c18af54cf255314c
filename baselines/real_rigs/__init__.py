"""Real rigs whose documentation says what is there: it is left out of the base model, and the diagnosis is asked for it."""

from baselines.real_rigs.entry import Documented, Figure, RealRig
from baselines.real_rigs.examine import absent, examine
from baselines.real_rigs.judge import judge

__all__ = ["Documented", "Figure", "RealRig", "absent", "examine", "judge"]

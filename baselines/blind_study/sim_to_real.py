"""What a better model is worth to an agent: the gap between what its simulation promised and what the concealed rig gives.

An agent trained on a drive does as well there as training could make it. On the rig it errs by more; that difference is the gap
which its drive left. Agents trained alike on several drives of one rig compare the drives.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from baselines.blind_study.payoff import reference, tried_agent
from baselines.blind_study.payoff_summary import Median, median
from baselines.evaluation.rollout import run_many
from baselines.loop_analysis.stability_limit import with_rig
from baselines.rig_simulator.truth import Truth
from baselines.rl.agents import Agent
from flexdrive_gym import Drive


@dataclass(frozen=True)
class Gap:
    """One agent, trained on one drive of a concealed rig.

    Attributes
    ----------
    drive
        Name of the drive.
    promised
        rms of xr - x2 along the handout's trajectory on the drive [mm].
    reached
        The same on the rig, with its nuisance [mm]; ``None`` where it left all bounds.
    stable
        Whether the rig was, in every run.
    """

    drive: str
    promised: float
    reached: float | None
    stable: bool

    @property
    def gap(self) -> float | None:
        """By how much the rig is off the promise [mm], either way."""
        return None if self.reached is None else abs(self.reached - self.promised)


def gaps(truth: Truth, drives: Mapping[str, Drive], agents: Mapping[str, Agent]) -> tuple[Gap, ...]:
    """Run every agent on the drive it was trained on and on the concealed rig.

    Parameters
    ----------
    truth
        The concealed rig.
    drives, agents
        Name to drive, and to the agent trained on it.
    """
    xr, found = reference(), []
    for name, agent in agents.items():
        rig = with_rig(drives[name])
        run = run_many(agent.controller(rig), [rig], xr)[0]
        promised = float(np.sqrt(np.mean((xr - run[2 if rig.carts == 2 else 0]) ** 2)))
        outcome = tried_agent(truth, name, agent, rig)
        found.append(Gap(name, promised, outcome.rms, outcome.stable))
    return tuple(found)


def mean_gaps(seeds: Sequence[Sequence[Gap]]) -> tuple[Gap, ...]:
    """Return the means over training seeds, per drive; an agent that left all bounds leaves its drive without a figure."""
    found = []
    for of in zip(*seeds, strict=True):
        reached = [g.reached for g in of if g.reached is not None]
        mean = float(np.mean(reached)) if len(reached) == len(of) else None
        found.append(Gap(of[0].drive, float(np.mean([g.promised for g in of])), mean, all(g.stable for g in of)))
    return tuple(found)


@dataclass(frozen=True)
class Closing:
    """What one drive's agents gain on those of another, in pairs over rigs.

    Attributes
    ----------
    better, other
        Names of the drives.
    closed
        Median share of the other's gap that is closed []; below 0 it is wider.
    ratio
        Median of the rms on the rig over the other's.
    """

    better: str
    other: str
    closed: Median
    ratio: Median


def closings(rigs: Sequence[Sequence[Gap]], better: str = "diagnosed") -> tuple[Closing, ...]:
    """Return what the better drive's agents gain on every other, over all rigs where both stayed within bounds."""
    others = dict.fromkeys(g.drive for found in rigs for g in found if g.drive != better)
    result = []
    for other in others:
        closed, ratio = [], []
        for found in rigs:
            of = {g.drive: g for g in found}
            a, b = of.get(better), of.get(other)
            if a is None or b is None or a.gap is None or not b.gap or a.reached is None or not b.reached:
                continue
            closed.append(1.0 - a.gap / b.gap)
            ratio.append(a.reached / b.reached)
        result.append(Closing(better, other, median(closed), median(ratio)))
    return tuple(result)

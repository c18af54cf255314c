"""What competes: classical designs at their sample times, and trained agents."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path

import numpy as np

from baselines.controllers import FAMILIES, SAMPLE_TIME_S, design
from baselines.evaluation.adapters import PolicyController
from baselines.evaluation.rollout import RIG_TIME_S, Previewed, run_many
from baselines.loop_analysis.stability_limit import with_rig
from baselines.rl.agents import Agent, agent_names, find_agent, load_agent
from flexdrive_gym import Controller, Drive, LinearController
from flexdrive_gym.references import random_moves

# the best of their kinds; the others' loops are theirs without a part
PREVIEWED = ("lab4", "lab4_friction", "lqg", "cascade_friction")
_LEAD_STEP_S = 5e-3
_TUNING_S = 8.0
READS = {"collocated": "x1", "non_collocated": "x2", "full_state": "x1, x2"}


@dataclass(frozen=True, eq=False)
class Entry:
    """A controller in the comparison.

    Attributes
    ----------
    name
        Unique.
    controller
        Anything with the protocol; it travels to other processes, so it must pickle.
    title
        In words.
    feedback
        Which encoders it reads.
    notes
        Of its design.
    group
        Entries that differ by their training seed alone share one; empty: a group of its own.
    period
        How often it acts [s]; in between its command is held.
    learnt
        Whether it was trained.
    """

    name: str
    controller: Controller | Previewed
    title: str = ""
    feedback: str = ""
    notes: tuple[str, ...] = ()
    group: str = ""
    period: float = SAMPLE_TIME_S
    learnt: bool = False

    @property
    def loop(self) -> Controller:
        """The controller without its preview, which is what margins are of."""
        return self.controller.controller if isinstance(self.controller, Previewed) else self.controller


def entries(
    drive: Drive, names: Sequence[str] = (), *, limit: float = inf, periods: Sequence[float] = (SAMPLE_TIME_S,)
) -> tuple[list[Entry], dict[str, str]]:
    """Design controllers by name; what cannot be designed is returned with its reason.

    Parameters
    ----------
    names
        Keys of :data:`~baselines.controllers.FAMILIES`; empty for all.
    limit
        Of the command [V].
    periods
        Sample times [s]; every controller is designed anew for each. At another than 1 ms its name says so: ``lab4@5ms``.

    Raises
    ------
    ValueError
        For an unknown name, or if nothing can be designed.
    """
    found: list[Entry] = []
    skipped: dict[str, str] = {}
    for period in periods:
        for name in names or FAMILIES:
            if name not in FAMILIES:
                design(name, drive)  # raises with the near match
            called = name if abs(period - SAMPLE_TIME_S) < 1e-9 else f"{name}@{1e3 * period:g}ms"
            try:
                made = design(name, drive, limit=limit, sample_time=period)
            except (ImportError, ValueError) as error:
                skipped[called] = str(error)
                continue
            found.append(Entry(called, made.controller, made.title, made.feedback, made.notes, called, period))
    if not found:
        raise ValueError("controllers: none can be designed; " + "; ".join(f"{k}: {v}" for k, v in skipped.items()))
    return found, skipped


def previewed_entries(drive: Drive, classical: Sequence[Entry], learnt: Sequence[Entry]) -> list[Entry]:
    """Return Lab 4, LQG and the cascade once more, with a preview of the reference as the learnt policies have.

    A policy sees the reference for some time ahead, which no design of the handout does. So that both know the same, each of
    :data:`PREVIEWED` among the classical entries is run with the reference shifted by a fixed lead, at most as long as the
    longest preview. The lead is the one with the least error along random moves, not along what is compared.

    Parameters
    ----------
    classical, learnt
        Of :func:`entries` and :func:`agent_entries`; without learnt ones there is nothing to match.
    """
    tasks = [e.controller.task for e in learnt if isinstance(e.controller, PolicyController)]
    longest = max((a for task in tasks for a in task.preview), default=0.0)
    leads = np.arange(0.0, longest + 1e-9, _LEAD_STEP_S)
    found = []
    for entry in classical:
        controller = entry.controller
        if longest <= 0.0 or entry.name not in PREVIEWED or not isinstance(controller, LinearController):
            continue
        told = min((Previewed(controller, float(lead)) for lead in leads), key=lambda c: _error(drive, c))
        name = f"{entry.name}+preview"
        title = f"{entry.title}, told the reference {1e3 * told.lead:g} ms ahead"
        found.append(replace(entry, name=name, group=name, title=title, controller=told))
    return found


def _error(drive: Drive, controller: Previewed) -> float:
    """Return the rms error along random moves [mm]."""
    t = np.arange(round(_TUNING_S / RIG_TIME_S)) * RIG_TIME_S
    xr = random_moves(t, np.random.default_rng(0))
    run = run_many(controller, [with_rig(drive)], xr)[0]
    return float(np.sqrt(np.mean((xr - run[2 if drive.carts == 2 else 0]) ** 2)))


def agent_entries(drive: Drive, names: Sequence[str] | None = None) -> list[Entry]:
    """Return trained agents as entries; those that read the same encoders are a group: ``rl_x2``, ``rl_x1``.

    Parameters
    ----------
    drive
        On which they shall run.
    names
        Names of ready-trained agents or policy files (.npz); ``None`` for all ready-trained ones.

    Raises
    ------
    ValueError
        For an unknown name, or what is no policy file.
    """
    found: dict[str, Entry] = {}
    # non-collocated first, as the handout has it
    for name in sorted(agent_names(), key=lambda n: not n.startswith("x2")) if names is None else names:
        agent = load_agent(Path(name)) if name.endswith(".npz") else find_agent(name)
        entry = _entry(agent, Path(name).stem, drive)
        if entry.name in found:
            raise ValueError(f"agents: names must be unique; got {entry.name!r} twice. Rename one of the files.")
        found[entry.name] = entry
    return list(found.values())


def _entry(agent: Agent, name: str, drive: Drive) -> Entry:
    controller = agent.on_scale_of(drive).controller(drive)
    reads, period = READS[controller.task.sensing], controller.task.control_period
    steps = agent.card.get("steps")
    trained = f", {steps / 1e6:.3g} million steps" if isinstance(steps, int | float) else ""
    previewed = max(controller.task.preview, default=0.0)
    return Entry(
        name,
        controller,
        f"learnt policy from {reads}, acts every {1e3 * period:g} ms"
        + (f", sees the reference {1e3 * previewed:g} ms ahead" if previewed else "")
        + trained,
        reads,
        group="rl_" + reads.replace(", ", "_"),
        period=period,
        learnt=True,
    )

"""What a better model of the drive is worth: controllers designed on identified drives, run on the concealed rig.

The same designs are made on each drive (the handout's tied fit, the free fit, the diagnosed drive) and run on one concealed
rig. All meet the same nuisance, so that figures of one rig may be compared in pairs; over rigs the medians of these pairs'
ratios say by how much a diagnosis pays.

Tracking is the handout's trajectory, in three runs after the recorded day, each with its own nuisance. The gain margin is
found by trial on the rig without nuisance. ``p_x2_half`` is P-control from x2 at half of the critical gain that the drive
predicts: its actual margin would be 2 if the prediction were right. ``lab4_ahead`` is Lab 4 with the command that all the
physics of its drive asks for along the trajectory (:mod:`baselines.controllers.iterative_learning`). A trained agent runs as
the design ``agent``; it is a black box, whose margins are not tried.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from math import isfinite
from typing import Any

import numpy as np

from baselines.controllers import FAMILIES, SAMPLE_TIME_S, design, effective
from baselines.controllers.iterative_learning import learn_feedforward
from baselines.controllers.p_control import proportional
from baselines.evaluation.metrics import measure
from baselines.loop_analysis.margins import margins as analytic
from baselines.loop_analysis.stability_limit import critical_gain as predicted_critical_gain
from baselines.loop_analysis.stability_limit import with_rig
from baselines.rig_simulator.critical_gain import LARGEST_FACTOR, critical_gain, gain_margin
from baselines.rig_simulator.ingredients import rig_values
from baselines.rig_simulator.kernel import LIMIT_V
from baselines.rig_simulator.rig import Law, Sampled, run
from baselines.rig_simulator.trials import after_the_day
from baselines.rig_simulator.truth import Truth
from baselines.rl.agents import Agent
from flexdrive_gym import Drive, LinearController, Observation
from flexdrive_gym.recording import FloatArray
from flexdrive_gym.references import handout_trajectory

# the ending of a design with a command by iterative learning control, as studies store it
P_HALF, LEARNING, AGENT = "p_x2_half", "_ahead", "agent"
DESIGNS = (P_HALF, "lab4", "lab4_friction", "lqg", f"lab4{LEARNING}")
SHARE = 0.5
DURATION_S = 8.0
RUNS = 3
# of all samples at the command's limit; a stable loop on the handout's trajectory needs it for moments only
VIBRATING_SHARE = 0.1


@dataclass(frozen=True)
class Outcome:
    """One design, made on one drive, on the rig.

    Attributes
    ----------
    drive, design
        Names.
    rms, peak
        Of xr - x2 [mm]; ``None`` where the design refused the drive.
    effort
        rms of the command [V].
    stable
        Within the travel, not growing and not vibrating between the command's limits, in every run.
    gain_margin
        Smallest factor on the command that makes the rig unstable by the contract's rule []; 20 stands for 20 and more.
    linear_margin
        The same on the rig without its dry friction: what linear theory means by a margin.
    predicted_margin
        What the drive promised: 2 for ``p_x2_half`` (to be held against ``gain_margin``), the design's own linear margin for the
        others (against ``linear_margin``); ``None`` where it is infinite.
    refused
        Why the drive was refused; empty where it was not.
    """

    drive: str
    design: str
    rms: float | None = None
    peak: float | None = None
    effort: float | None = None
    stable: bool = False
    gain_margin: float | None = None
    linear_margin: float | None = None
    predicted_margin: float | None = None
    refused: str = ""

    @property
    def margin(self) -> float | None:
        """By the contract's rule for P-control, which its gain was made for; without dry friction for all others."""
        return self.gain_margin if self.design == P_HALF else self.linear_margin


@dataclass(frozen=True)
class Payoff:
    """All designs on all drives, on one concealed rig.

    Attributes
    ----------
    true_critical_gain
        Of P-control from x2 on the rig [V/mm]; ``None`` where none exists below 10 V/mm.
    predicted_critical_gain
        What each drive predicts for it [V/mm].
    outcomes
        One per drive and design.
    """

    true_critical_gain: float | None
    predicted_critical_gain: Mapping[str, float | None]
    outcomes: tuple[Outcome, ...]

    def as_json(self) -> dict[str, Any]:
        """Return the result as plain numbers, text, lists and dictionaries."""
        return {
            "true_critical_gain": self.true_critical_gain,
            "predicted_critical_gain": dict(self.predicted_critical_gain),
            "outcomes": [asdict(outcome) for outcome in self.outcomes],
        }

    @classmethod
    def from_json(cls, found: Mapping[str, Any]) -> Payoff:
        """Return the result that :meth:`as_json` wrote."""
        return cls(
            found["true_critical_gain"],
            dict(found["predicted_critical_gain"]),
            tuple(Outcome(**outcome) for outcome in found["outcomes"]),
        )

    def find(self, drive: str, made: str) -> Outcome | None:
        """Return the outcome of a design on a drive, unless there is none or it was refused."""
        for outcome in self.outcomes:
            if (outcome.drive, outcome.design) == (drive, made) and not outcome.refused:
                return outcome
        return None


def law_of(controller: LinearController) -> Law:
    """Return a controller as the blind rig reads it."""
    c = controller
    assert c.L is not None
    return Law(c.A, c.B, c.C, c.D, c.L, min(c.limit, LIMIT_V), c.friction, c.threshold, c.shaper)


def payoff(
    truth: Truth,
    drives: Mapping[str, Drive],
    designs: Iterable[str] = DESIGNS,
    agents: Mapping[str, Agent] | None = None,
) -> Payoff:
    """Design on every drive, run on the concealed rig.

    Parameters
    ----------
    truth
        The concealed rig.
    drives
        Name to drive, as a rule ``tied``, ``free`` and ``diagnosed``.
    designs
        Names of :data:`baselines.controllers.FAMILIES`, each also with ``_ahead``, and ``p_x2_half``.
    agents
        Name of a drive to the agent that was trained on it.

    Raises
    ------
    ValueError
        For an unknown design, or an agent of no drive.
    """
    unknown = set(agents or {}) - set(drives)
    if unknown:
        raise ValueError(
            f"agents: must belong to {', '.join(drives)}; got {', '.join(sorted(unknown))}. Give an agent the name of its drive."
        )
    chosen = tuple(designs)
    predicted = {name: _predicted(drive) for name, drive in drives.items()}
    margins: dict[bytes, tuple[float, float]] = {}
    outcomes = []
    for name, drive in drives.items():
        for made in chosen:
            try:
                controller, feedforward, promise = _made(made, drive, predicted[name])
            except _RefusedError as error:
                outcomes.append(Outcome(name, made, refused=str(error)))
                continue
            law = law_of(controller)
            key = law.flat().tobytes()
            if key not in margins:  # a feedforward command leaves the margin alone
                with_friction, without = (gain_margin(truth, law, friction=f) or LARGEST_FACTOR for f in (True, False))
                margins[key] = with_friction, without
            tried = _tried(truth, name, made, margins[key], law, feedforward)
            outcomes.append(replace(tried, predicted_margin=promise))
    outcomes += [tried_agent(truth, name, agent, drives[name]) for name, agent in (agents or {}).items()]
    return Payoff(critical_gain(truth), predicted, tuple(outcomes))


class _RefusedError(ValueError):
    """A design that cannot be made on a drive."""


def _predicted(drive: Drive) -> float | None:
    return predicted_critical_gain(drive, "x2") if drive.carts == 2 else None


def reference() -> FloatArray:
    """Return the handout's trajectory as it is tracked on the rig, ndarray, shape (n,) [mm]."""
    return handout_trajectory(np.arange(round(DURATION_S / SAMPLE_TIME_S) + 1) * SAMPLE_TIME_S)


def _made(name: str, drive: Drive, predicted: float | None) -> tuple[LinearController, FloatArray | None, float | None]:
    """Return a controller, its feedforward command by iterative learning control, and the gain margin that its drive promises."""
    if name == P_HALF:
        if predicted is None:
            raise _RefusedError("drive: predicts no critical gain below 10 V/mm, so there is no share of it")
        return proportional(SHARE * predicted), None, 1.0 / SHARE
    design_name = name.removesuffix(LEARNING)
    if design_name not in FAMILIES:
        raise ValueError(f"designs: must be among {P_HALF}, {', '.join(FAMILIES)}, also with {LEARNING}; got {name!r}.")
    rig = with_rig(drive)
    try:
        controller = design(design_name, rig).controller
        feedforward = learn_feedforward(rig, controller, reference()) if name.endswith(LEARNING) else None
    except ValueError as error:
        raise _RefusedError(str(error)) from error
    return (
        controller,
        feedforward,
        _plain(analytic(effective(rig, FAMILIES[design_name].reads), controller).gain_margin),
    )


def tried_agent(truth: Truth, name: str, agent: Agent, drive: Drive) -> Outcome:
    """Run an agent on the concealed rig; ``name`` is that of the drive it was trained on."""
    controller = agent.controller(with_rig(drive), SAMPLE_TIME_S).following(reference())

    def asked(t: float, xr: float, x1: float, x2: float) -> float:
        if t == 0.0:
            controller.reset()
        return controller(Observation(t, xr, x1, x2, 0.0, 0.0))

    return _tried(truth, name, AGENT, (None, None), asked)


def _tried(
    truth: Truth,
    drive: str,
    made: str,
    margins: tuple[float | None, float | None],
    controller: Law | Sampled,
    feedforward: FloatArray | None = None,
) -> Outcome:
    """Run the handout's trajectory on the rig with its nuisance."""
    xr, values, base = reference(), rig_values(truth), Drive(dict(truth.drive))
    found = []
    for i in range(RUNS):
        world = after_the_day(truth, len(xr), i)
        motion = run(values, world, xr, controller=controller, feedforward=feedforward)
        # the reference counts from where the cart stood when the encoders were switched on
        states = motion.states - motion.states[:, :1]
        found.append(measure(base, xr, states, motion.u, SAMPLE_TIME_S, limit=LIMIT_V))
    return Outcome(
        drive, made,
        rms=_plain(float(np.sqrt(np.mean([m.rms**2 for m in found])))),
        peak=_plain(max(m.peak for m in found)),
        effort=_plain(float(np.sqrt(np.mean([m.effort**2 for m in found])))),
        stable=all(m.stable and m.limited < VIBRATING_SHARE for m in found),
        gain_margin=margins[0],
        linear_margin=margins[1],
    )  # fmt: skip


def _plain(value: float) -> float | None:
    return value if isfinite(value) else None

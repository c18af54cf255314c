"""A rig that conceals an effect, and the experiments a student makes on it.

The rig is that of :mod:`baselines.rig_simulator`, an independent program with the run-to-run variability of the real rigs;
nobody but :func:`answer` asks for what it conceals.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from secrets import randbelow
from typing import Literal

from baselines.lab_page import texts
from baselines.report.words import effect_name
from baselines.rig_simulator.catalogue import CATALOGUE
from baselines.rig_simulator.ingredients import rig_values
from baselines.rig_simulator.recordings import Experiment, Log, as_text, command
from baselines.rig_simulator.rig import p_law, run
from baselines.rig_simulator.trials import after_the_day
from baselines.rig_simulator.truth import Truth, draw_truth
from flexdrive_gym.files import write_atomically

Kind = Literal["square", "sine", "p_control"]
MOST_RUNS = 24
LARGEST_V = 8.0
# one rig in eight conceals nothing: a student who names something every time is wrong then
_NOTHING_IN = 8
# plainly present, and twice that
_SIZES = (1.0, 2.0)
NOTHING = "nothing"


@dataclass
class Exercise:
    """One concealed rig.

    Attributes
    ----------
    truth
        What is concealed; nothing shows it before a guess.
    runs
        How many experiments were made.
    """

    truth: Truth
    runs: int = 0


def conceal(seed: int | None = None) -> Exercise:
    """Return a rig that conceals an effect of the catalogue, or in one case of eight none.

    Parameters
    ----------
    seed
        Everything follows from it; drawn if not given.
    """
    drawn = randbelow(2**31) if seed is None else seed
    if drawn % _NOTHING_IN == 0:
        return Exercise(draw_truth(drawn, "null"))
    return Exercise(draw_truth(drawn, "effect", size=_SIZES[drawn % len(_SIZES)]))


def choices() -> dict[str, str]:
    """Return what can be guessed: ``id@where`` to words."""
    return {NOTHING: texts.GUESS_NOTHING} | {f"{m.id}@{m.where}": named(m.id, m.where) for m in CATALOGUE}


def named(effect: str, where: str) -> str:
    """Return an effect at a place in words."""
    return texts.EFFECT_OF.format(name=effect_name(effect), where=where.replace("_", " "))


def conduct(exercise: Exercise, folder: Path, kind: Kind, amplitude: float, frequency: float) -> Path:
    """Make one experiment and write its recording.

    Parameters
    ----------
    exercise
        The rig; it counts its runs.
    folder
        Of the recordings.
    kind
        ``square`` or ``sine`` in open loop, or the handout's trajectory under P-control from x2.
    amplitude
        Of the command [V], or Kp [V/mm].
    frequency
        [Hz]

    Raises
    ------
    ValueError
        For more runs than a rig takes, or a command beyond the amplifier's.
    """
    if exercise.runs >= MOST_RUNS:
        raise ValueError(texts.MOST_RUNS.format(most=MOST_RUNS))
    if not 0.0 < amplitude <= LARGEST_V or not 0.05 <= frequency <= 40.0:
        raise ValueError(
            f"experiment: the amplitude must lie in (0, {LARGEST_V:g}] and the frequency in [0.05, 40] Hz; got {amplitude:g} and "
            f"{frequency:g}."
        )
    number = exercise.runs + 1
    closed = kind == "p_control"
    unit = f"kp{amplitude:.4g}" if closed else f"{amplitude:g}V_{frequency:g}Hz"
    experiment = Experiment(f"{number:02d}_{kind}_{unit}", kind, amplitude, frequency)
    asked = command(experiment)
    world = after_the_day(exercise.truth, len(asked), exercise.runs)
    motion = run(rig_values(exercise.truth), world, asked, controller=p_law(amplitude) if closed else None)
    log = Log(experiment, motion.u, motion.counts, motion.shown, asked if closed else None)
    concealed = {(e.id, e.where) for e in exercise.truth.effects}
    rectified = (("rectified_sensor", "encoder_1") in concealed, ("rectified_sensor", "encoder_2") in concealed)
    path = write_atomically(folder / f"{experiment.name}.csv", as_text(log, rectified))
    exercise.runs = number
    return path


@dataclass(frozen=True)
class Answer:
    """How a guess compares with the truth.

    Attributes
    ----------
    right
        Whether effect and place are right.
    sentence
        What is said.
    """

    right: bool
    sentence: str


def answer(exercise: Exercise, guess: str) -> Answer:
    """Compare a guess, a key of :func:`choices`, with the truth, and tell it."""
    concealed = exercise.truth.effects
    if not concealed:
        right = guess == NOTHING
        return Answer(right, (texts.RIGHT if right else texts.WRONG).format(truth=texts.NOTHING_CONCEALED))
    effect = concealed[0]
    truth = named(effect.id, effect.where)
    if effect.parameters:
        numbers = ", ".join(f"{name} = {value:.3g}" for name, value in effect.parameters.items())
        truth = texts.WITH_PARAMETERS.format(truth=truth, parameters=numbers)
    if guess == f"{effect.id}@{effect.where}":
        return Answer(True, texts.RIGHT.format(truth=truth))
    near = guess.partition("@")[0] == effect.id
    return Answer(False, (texts.RIGHT_NAME if near else texts.WRONG).format(truth=truth))

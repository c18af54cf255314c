"""``flexdrive train``."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from baselines.cli._command import MOST_SEED, MOST_THREADS
from baselines.cli._output import Json, number, print_json, progress, say, table
from baselines.cli._results import Force, interrupted_says, require_unfinished

if TYPE_CHECKING:
    from baselines.rl.agents import Agent
    from baselines.rl.training import Plan, Trained, UnderWay
    from flexdrive_gym import Drive


# a rollout of these many with 64 observations each is some GB
MOST_DRIVES = 16_384
_NAME = "agent"


@dataclass(frozen=True)
class _Training:
    """A training: on which drive, how, under which name, and which agent it repeats."""

    rig: Drive
    plan: Plan
    name: str
    checkpoint_every: int
    original: Agent | None


class Feedback(StrEnum):
    """The encoder that the agent reads."""

    x1 = "x1"
    x2 = "x2"


def train(
    ctx: typer.Context,
    drive: Annotated[
        Path | None,
        typer.Argument(
            exists=True, dir_okay=False, metavar="DRIVE", help="A drive.toml; default: the rig of winter 2022."
        ),
    ] = None,
    output: Annotated[
        Path, typer.Option("--output", "-o", file_okay=False, help="Folder for the agent, its card and checkpoints.")
    ] = Path("agent"),
    feedback: Annotated[
        Feedback, typer.Option(help="Encoder the agent reads: x1 (collocated) or x2 (non-collocated).")
    ] = Feedback.x2,
    seed: Annotated[
        int, typer.Option(min=0, max=MOST_SEED, help="Of weights, exploration, drives and references.")
    ] = 0,
    steps: Annotated[int, typer.Option(min=1, max=10**12, help="Control periods of all drives together.")] = 500_000,
    envs: Annotated[int, typer.Option(min=1, max=MOST_DRIVES, help="Drives side by side.")] = 64,
    history: Annotated[int, typer.Option(min=1, max=64, help="Observations the agent looks at.")] = 4,
    threads: Annotated[int, typer.Option(min=1, max=MOST_THREADS, help="Of torch; more help only large networks.")] = 1,
    checkpoint_every: Annotated[int, typer.Option(min=1, max=10**12, help="Steps between checkpoints.")] = 100_000,
    resume: Annotated[
        bool,
        typer.Option(
            "--resume",
            help="Go on from the checkpoint in the folder, with its drive and options; --steps may ask for more.",
        ),
    ] = False,
    reproduce: Annotated[
        str | None,
        typer.Option(
            metavar="NAME", help="Retrain a ready-trained agent: drive and options as its card says; compare."
        ),
    ] = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Train a reinforcement-learning agent on the drive and on drives around it.

    Ctrl-C or a kill loses at most what came after the last checkpoint: flexdrive train --resume -o FOLDER goes on.
    """
    try:
        from baselines.rl import training  # noqa: PLC0415
    except ImportError as error:
        raise ValueError(f"train: {error.name} is not installed. pip install 'flexdrive[rl]'.") from error
    from baselines.lab.lab_scale import on_lab_scale  # noqa: PLC0415
    from flexdrive_gym import load_drive  # noqa: PLC0415
    from flexdrive_gym.files import only_writer  # noqa: PLC0415

    if reproduce is not None and drive is not None:
        raise ValueError(f"drive: {reproduce} is retrained on the drive of its card; got {drive} too. Leave DRIVE out.")
    own = None if drive is None else on_lab_scale(load_drive(drive))
    plan = training.Plan(feedback.value, seed, steps, envs, history, threads)
    if resume:
        given = {name for name in ctx.params if getattr(ctx.get_parameter_source(name), "name", "") == "COMMANDLINE"}
        course = _resumed(training.under_way(output), own, plan, given, reproduce)
        if "checkpoint_every" in given:
            course = replace(course, checkpoint_every=checkpoint_every)
    else:
        require_unfinished(output, training.AGENT, force=force)
        course = _begun(own, plan, reproduce, checkpoint_every)
    with interrupted_says(lambda: _kept(output)), only_writer(output):
        trained = _watched(course, output, resume=resume)
    files = [output / name for name in (training.AGENT, training.CARD, training.CURVE)]
    same = None if course.original is None else compared(course.original, trained.agent)
    if json:
        print_json({"card": trained.agent.card, "curve": trained.curve, "files": files, "reproduced": same})
        return
    _print(course, trained)
    if same is not None:
        say(sentence(same))
    log = output / training.LOG
    say(
        f"learning curves: tensorboard --logdir {log}"
        if log.exists()
        else "note: no TensorBoard log; pip install tensorboard"
    )
    for path in files:
        say(f"wrote {path}")


def _print(course: _Training, trained: Trained) -> None:
    """Print the scores of an agent."""
    from baselines.rl.training import score_key  # noqa: PLC0415

    rig, card = course.rig, trained.agent.card
    units = rig.units
    rms, handout, peak = (
        card["score"][score_key(units, key)]
        for key in ("rms_mm_unseen_references", "rms_mm_handout", "peak_mm_handout")
    )
    table(
        f"agent from {course.plan.feedback} on {rig.name}",
        [*map(units.label, ("steps", "time [s]", "rms e, unseen references [mm]", "rms e, handout [mm]",
                            "peak e, handout [mm]"))],
        [[f"{card['steps']:,}", number(card["seconds"], 3), number(rms, 3), number(handout, 3), number(peak, 3)]],
    )  # fmt: skip


def _kept(output: Path) -> str:
    """Say after Ctrl-C what there is to go on from."""
    from baselines.rl.training import CHECKPOINT  # noqa: PLC0415

    if (output / CHECKPOINT).exists():
        return f"the training so far is kept in {output / CHECKPOINT}; go on with --resume: flexdrive train --resume -o {output}"
    return "nothing had been learnt yet. The same command begins again."


def _resumed(rest: UnderWay, own: Drive | None, asked: Plan, given: set[str], reproduce: str | None) -> _Training:
    """Return the checkpoint's training, with more steps if that is asked for; refuse by name what else is asked differently."""
    from baselines.rl.agents import find_agent  # noqa: PLC0415

    then, now = asdict(rest.plan), asdict(asked)
    if reproduce is not None and reproduce != rest.name:
        raise ValueError(f"resume: the checkpoint is of {rest.name!r}; got --reproduce {reproduce}. Leave it out.")
    for option in sorted(given & set(now) - {"steps"}):
        if now[option] != then[option]:
            raise ValueError(
                f"resume: goes on with the options of the checkpoint; it had --{option} {then[option]}, and got --{option} "
                f"{now[option]}. Leave it out, or train in another folder."
            )
    plan = replace(rest.plan, steps=asked.steps) if "steps" in given else rest.plan
    original = None if rest.name == _NAME else find_agent(rest.name)
    return _Training(rest.drive if own is None else own, plan, rest.name, rest.checkpoint_every, original)


def _begun(own: Drive | None, asked: Plan, reproduce: str | None, checkpoint_every: int) -> _Training:
    """Return a training from its beginning; that of a ready-trained agent has drive and plan of its card."""
    from baselines.rl.agents import find_agent  # noqa: PLC0415
    from baselines.rl.training import Plan  # noqa: PLC0415
    from flexdrive_gym import DEFAULT_DRIVE  # noqa: PLC0415

    if reproduce is None:
        return _Training(DEFAULT_DRIVE if own is None else own, asked, _NAME, checkpoint_every, None)
    original = find_agent(reproduce)
    if dict(original.card["drive_parameters"]) != dict(DEFAULT_DRIVE.values):
        raise ValueError(f"reproduce: {original.name} was trained on another drive, {original.card['drive']!r}.")
    return _Training(DEFAULT_DRIVE, Plan(**original.card["plan"]), reproduce, checkpoint_every, original)


def _watched(course: _Training, output: Path, *, resume: bool) -> Trained:
    """Train with a progress bar."""
    from baselines.rl.training import train as run  # noqa: PLC0415

    with progress() as bar:
        task = bar.add_task("training", total=course.plan.steps)

        def tell(done: int, error: float) -> None:
            bar.update(task, completed=done, description=f"training, rms e {error:.3g} {course.rig.units.length}")

        return run(
            course.rig, course.plan, output,
            name=course.name, checkpoint_every=course.checkpoint_every, resume=resume, tell=tell,
        )  # fmt: skip


def compared(original: Agent, again: Agent) -> dict[str, object]:
    """Return by how much a retrained agent differs from the original: weights, and scores in mm."""
    import numpy as np  # noqa: PLC0415

    pairs = [
        (a, b) for one, two in zip(original.layers, again.layers, strict=True) for a, b in zip(one, two, strict=True)
    ]
    scores = {
        name: [agent.card["score"][name] for agent in (original, again)]
        for name in ("rms_mm_unseen_references", "rms_mm_handout")
    }
    return {
        "name": original.name,
        "equal": all(np.array_equal(a, b) for a, b in pairs),
        "largest_weight_difference": max(float(np.max(np.abs(np.subtract(a, b)))) for a, b in pairs),
        "scores": scores,
    }


def sentence(same: dict[str, object]) -> str:
    """Say what :func:`compared` found."""
    if same["equal"]:
        return f"{same['name']} is reproduced bit by bit."
    scores = same["scores"]
    assert isinstance(scores, dict)
    (a, b), (c, d) = scores["rms_mm_unseen_references"], scores["rms_mm_handout"]
    return (
        f"{same['name']} is not reproduced bit by bit (weights differ by up to {same['largest_weight_difference']:.2g}); "
        f"rms e on unseen references {a:.3g} mm then, {b:.3g} mm now; on the handout's trajectory {c:.3g} mm then, {d:.3g} mm "
        "now. "
        "Other versions or another processor round differently."
    )

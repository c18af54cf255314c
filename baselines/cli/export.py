"""``flexdrive export``."""

from __future__ import annotations

import shlex
import sys
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from baselines.cli._output import DriveFile, Json, print_json, progress, say, table
from baselines.cli._results import result_file

if TYPE_CHECKING:
    from collections.abc import Sequence

    from baselines.export import Difference, Exported
    from flexdrive_gym import Drive

_SUFFIX = {"matlab": ".m", "mujoco": ".xml", "c": ".c"}


class Target(StrEnum):
    """What a drive, a controller or an agent is written for."""

    matlab = "matlab"
    mujoco = "mujoco"
    c = "c"


def export(
    drive: DriveFile,
    to: Annotated[
        Target,
        typer.Option(
            help="matlab: a function file, which Octave takes too. mujoco: MJCF, of a drive. c: plain C99 with a header, of a "
            "controller or an agent."
        ),
    ],
    output: Annotated[
        Path,
        typer.Option(
            "--output", "-o", metavar="PATH", help="A file (.m, .xml, .c), whose name becomes that of the function, or a folder."
        ),
    ],
    controller: Annotated[
        str | None,
        typer.Option(
            "--controller", "-c",
            help="Instead of the drive, a linear controller designed for it: a name as in 'flexdrive compare' (lab4, lqg, "
            "cascade, …), or your own.toml.",
        ),
    ] = None,
    agent: Annotated[
        str | None,
        typer.Option("--agent", "-a", help="Instead of the drive, a trained agent: a name (x2-0, …) or its file (.npz)."),
    ] = None,
    period: Annotated[
        float | None,
        typer.Option(min=0.01, max=1000.0, help="Sample time of the rig, or of a controller that is designed [ms]; default: 1."),
    ] = None,
    check: Annotated[
        bool,
        typer.Option("--check", help="Run the file in Octave, MuJoCo or a C compiler and print how far it is from our own run."),
    ] = False,
    json: Json = False,
) -> None:  # fmt: skip
    """Write a drive, a linear controller or a trained agent for MATLAB, MuJoCo or a target in C99.

    The drive: parameters, tf, ss and a function of one step with friction and all its effects (matlab), or a model (mujoco).
    What a tool cannot hold is named on the screen and in the file. Numbers are in the rig's own units.
    """
    from flexdrive_gym import load_drive  # noqa: PLC0415
    from flexdrive_gym.files import write_atomically  # noqa: PLC0415

    if controller is not None and agent is not None:
        raise ValueError(
            f"agent: one thing goes into a file; got --controller {controller} and --agent {agent}. Call twice."
        )
    rig = load_drive(drive)
    what = controller or agent
    source = drive.stem if what is None else what if Path(what).suffix == "" else Path(what).stem
    path = _file(output, to, source)
    job = _Job(rig, to, _named(path, to), _given(), 1e-3 * (period or 1.0))
    with progress() as bar:
        task = bar.add_task("writing", total=None)
        exported, differ = _exported(job, controller, agent, period)
        header = path.with_suffix(".h") if exported.header else None
        written = [result_file(p) for p in (path, header) if p is not None]
        if header is not None:
            write_atomically(header, exported.header)
        write_atomically(path, exported.text)
        found, missing = None, ""
        if check:
            bar.update(task, description="checking")
            found, missing = _checked(differ)
    if json:
        print_json({
            "to": to.value, "files": written, "held": exported.held, "left_out": exported.left_out, "notes": exported.notes,
            "differences": None if found is None else [_in_rig(d, rig) for d in found], "not_checked": missing or None,
        })  # fmt: skip
        return
    _print(exported, written)
    if found is not None:
        _print_differences(found, rig)
    if missing:
        say(f"not checked: {missing}")


@dataclass(frozen=True)
class _Job:
    """What is exported and how."""

    rig: Drive
    to: Target
    name: str
    command: str
    period: float


def _file(output: Path, to: Target, source: str) -> Path:
    """Return the file to write: the one that was named, or one in the folder that was."""
    from baselines.export import identifier  # noqa: PLC0415

    suffix = _SUFFIX[to]
    if output.suffix == suffix:
        return output
    if output.is_dir() or not output.suffix:
        return output / f"{identifier(source)}{suffix}"
    raise ValueError(
        f"output: --to {to} writes a file that ends in {suffix}; got {output}. Try -o {output.with_suffix(suffix)}."
    )


def _named(path: Path, to: Target) -> str:
    """Return the name of what is in a file; that of a model need not be the file's."""
    from baselines.export import function_name, identifier  # noqa: PLC0415

    return identifier(path.stem) if to is Target.mujoco else function_name(path)


def _given() -> str:
    """Return the command line, for the header of the file."""
    return shlex.join(["flexdrive", *sys.argv[1:]]) if len(sys.argv) > 1 else "flexdrive export"


def _exported(job: _Job, controller: str | None, agent: str | None, period: float | None) -> tuple[Exported, Any]:
    """Return what was asked for, and a function that compares it with our own run."""
    if agent is not None:
        return _agent(job, agent, period)
    if controller is not None:
        return _controller(job, controller, period)
    return _drive(job, period)


def _drive(job: _Job, period: float | None) -> tuple[Exported, Any]:
    from baselines import export as exporting  # noqa: PLC0415

    if job.to is Target.c:
        raise ValueError(
            "to: C99 is written of a controller or an agent; got a drive. Add --controller or --agent, or --to matlab."
        )
    if job.to is Target.mujoco:
        if period is not None:
            raise ValueError(f"period: a model in MuJoCo has its own step; got {period:g} ms. Leave --period out.")
        made = exporting.export_mujoco(job.rig, job.name, command=job.command)
        return made, lambda: exporting.verify_mujoco(job.rig, made)
    made = exporting.export_matlab(job.rig, job.name, sample_time=job.period, command=job.command)
    time = job.period * job.rig.units.per_time
    return made, lambda: exporting.verify_matlab(job.rig, made, job.name, time)


def _controller(job: _Job, name: str, period: float | None) -> tuple[Exported, Any]:
    from baselines import export as exporting  # noqa: PLC0415
    from baselines.compare import is_own, load_own  # noqa: PLC0415
    from baselines.controllers import design  # noqa: PLC0415
    from flexdrive_gym import LinearController  # noqa: PLC0415

    _needs_code(job, "controller")
    units = job.rig.units
    about: tuple[str, ...]
    if is_own(name):
        if period is not None:
            raise ValueError(f"period: {name} has a sample time of its own; got {period:g} ms. Leave --period out.")
        law, about = load_own(name, job.rig, job.rig.voltage_limit).controller, (f"read from {Path(name).name}",)
        if not isinstance(law, LinearController):
            raise ValueError(
                f"controller: only a linear controller is data that can be written elsewhere; got {name}. Describe it in a "
                "TOML file (docs/controllers.md)."
            )
    else:
        made = design(name, job.rig, sample_time=job.period * units.per_time)
        law = made.controller
        values = [f"{symbol} = {units.text(value, unit)}" for symbol, (value, unit) in made.values.items()]
        about = (f"{made.title}, designed for {job.rig.name}", *values, *made.notes)
    exported = exporting.export_linear(law, job.name, job.to.value, units=units, about=about, command=job.command)
    return exported, lambda: exporting.verify_controller(law, job.rig, exported, job.name, job.to.value)


def _agent(job: _Job, name: str, period: float | None) -> tuple[Exported, Any]:
    from baselines import export as exporting  # noqa: PLC0415
    from baselines.rl.agents import find_agent, load_agent  # noqa: PLC0415

    _needs_code(job, "agent")
    if period is not None:
        raise ValueError(
            f"period: an agent acts at the period it was trained for; got {period:g} ms. Leave --period out."
        )
    agent = load_agent(name) if name.endswith(".npz") else find_agent(name)
    card = agent.card
    about = [f"{key}: {card[key]}" for key in ("command", "commit", "drive") if card.get(key)]
    units = job.rig.units
    if not units.lab:
        length, command = units.text(1.0, "mm"), units.text(1.0, "V")
        about.append(
            f"Positions are in mm and commands in V of the scale it was trained on: 1 mm is {length}, 1 V is {command}."
        )
    exported = exporting.export_agent(agent, job.name, job.to.value, drive=job.rig, about=about, command=job.command)
    return exported, lambda: exporting.verify_controller(agent, job.rig, exported, job.name, job.to.value)


def _needs_code(job: _Job, option: str) -> None:
    if job.to is Target.mujoco:
        raise ValueError(f"to: MuJoCo's models hold drives; got --{option}. Write it with --to matlab or --to c.")


def _checked(differ: Any) -> tuple[list[Difference] | None, str]:
    from baselines.export import Missing  # noqa: PLC0415

    try:
        return differ(), ""
    except Missing as missing:
        return None, str(missing)
    except RuntimeError as error:
        raise ValueError(f"check: the file does not run: {error}") from error


def _in_rig(d: Difference, rig: Drive) -> dict[str, object]:
    largest, unit = rig.units.of_rig(d.largest, d.unit)
    return {
        "case": d.case, "signal": d.signal, "unit": unit, "largest": largest, "relative": d.relative, "samples": d.samples,
        "equal": d.equal,
    }  # fmt: skip


def _print(exported: Exported, written: Sequence[Path]) -> None:
    for line in exported.held:
        say(f"held: {line}")
    for line in exported.left_out:
        say(f"left out: {line}")
    for line in exported.notes:
        say(f"note: {line}")
    for path in written:
        say(f"wrote {path}")


def _print_differences(found: Sequence[Difference], rig: Drive) -> None:
    rows = [_in_rig(d, rig) for d in found]
    table(
        "difference from our own run",
        ["run", "signal", "largest", "unit", "of the peak", "samples", "equal in all bits"],
        [
            [str(r["case"]), str(r["signal"]), f"{r['largest']:.2g}", str(r["unit"]), f"{r['relative']:.2g}", str(r["samples"]),
             str(r["equal"])]
            for r in rows
        ],
    )  # fmt: skip

"""Run what was exported in its own tool and compare it with our run: Octave, MuJoCo, a C compiler."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from baselines.evaluation.adapters import PolicyController
from baselines.export.exported import Exported
from baselines.export.linear import in_units
from baselines.export.mjcf import TIMESTEP_S, mujoco_units
from baselines.export.templating import fill
from baselines.rl.agents import Agent
from flexdrive_gym import Drive, LinearController
from flexdrive_gym.recording import FloatArray, Recording
from flexdrive_gym.references import sample_reference

TRIAL_S = 1.0
_TIMEOUT_S = 600.0
_SIGNALS = (("x1", "mm"), ("x2", "mm"), ("v1", "mm/s"), ("v2", "mm/s"))


class Missing(Exception):  # noqa: N818  (it is no error: the file is as good without)
    """The tool in which an export would be run is not on this machine."""


@dataclass(frozen=True)
class Difference:
    """How far another tool's run is from ours.

    Attributes
    ----------
    case
        What was run.
    signal, unit
        Which was compared; unit is the lab's name, values are the engine's.
    largest
        Largest difference.
    peak
        Largest value of our run.
    samples, equal
        How many were compared, and how many of them have the same bits.
    """

    case: str
    signal: str
    unit: str
    largest: float
    peak: float
    samples: int
    equal: int

    @property
    def relative(self) -> float:
        """Largest difference over the peak []."""
        return self.largest / self.peak if self.peak > 0.0 else self.largest


def _difference(case: str, signal: str, unit: str, theirs: FloatArray, ours: FloatArray) -> Difference:
    return Difference(
        case,
        signal,
        unit,
        float(np.max(np.abs(theirs - ours))),
        float(np.max(np.abs(ours))),
        len(ours),
        int(np.sum(theirs == ours)),
    )


def trials(drive: Drive, sample_time: float) -> dict[str, FloatArray]:
    """Return commands that show how friction is treated [V]: a fast sine, stick-slip, a square, rest below friction."""
    t = np.arange(round(TRIAL_S / sample_time)) * sample_time
    friction = drive["d1"] + (drive["d2"] if drive.carts == 2 else 0.0)
    level = friction if friction > 0.0 else 0.6
    sine = np.sin(2.0 * np.pi * 2.0 * t)
    commands = {
        "sine": 4.0 * level * np.sin(2.0 * np.pi * 3.0 * t),
        "stick-slip": 1.5 * level * sine,
        "square": 2.5 * level * np.where(sine >= 0.0, 1.0, -1.0),
    }
    if friction > 0.0:
        commands["at rest"] = np.full(len(t), 0.5 * drive["d1"])
    return commands


def _compare(case: str, theirs: FloatArray, run: Recording, carts: int) -> list[Difference]:
    """Compare columns x1, x2, v1, v2 in the engine's units."""
    found = []
    for i, (name, unit) in enumerate(_SIGNALS):
        ours = getattr(run, name)
        if ours is not None and (carts == 2 or name in ("x1", "v1")):
            found.append(_difference(case, name, unit, theirs[:, i], ours))
    return found


def verify_matlab(drive: Drive, exported: Exported, name: str, sample_time: float = 1e-3) -> list[Difference]:
    """Run a drive's MATLAB file in Octave.

    Parameters
    ----------
    drive
        That was exported.
    exported
        Its file.
    name
        Of the function.
    sample_time
        For which it was exported [s of the engine].

    Raises
    ------
    Missing
        Without Octave.
    RuntimeError
        If Octave reports an error.
    """
    units, found = drive.units, []
    scale = np.array([units.one(unit) for _name, unit in _SIGNALS])
    with _folder({f"{name}.m": exported.text}) as folder:
        commands = trials(drive, sample_time)
        lines = [f"d = {name}();"]
        for i, u in enumerate(commands.values()):
            np.savetxt(folder / f"u{i}.csv", u / units.one("V"), fmt="%.17g")
            lines.append(f"dlmwrite('y{i}.csv', d.simulate(dlmread('u{i}.csv'), d.p), 'precision', '%.17g');")
        octave(folder, "\n".join(lines))
        for i, (case, u) in enumerate(commands.items()):
            t = np.arange(len(u)) * sample_time
            # the command as it was written down, so that both runs get the same
            run = drive.simulate(t, u / units.one("V") * units.one("V"))
            found += _compare(case, np.loadtxt(folder / f"y{i}.csv", delimiter=",") * scale, run, drive.carts)
    return found


def verify_mujoco(drive: Drive, exported: Exported) -> list[Difference]:
    """Run a drive's MJCF in MuJoCo; what MuJoCo cannot hold counts as difference.

    Raises
    ------
    Missing
        Without MuJoCo.
    """
    try:
        import mujoco  # noqa: PLC0415
    except ModuleNotFoundError as error:
        raise Missing("mujoco is not installed; run: pip install 'flexdrive[mujoco]'") from error
    units, _turns = mujoco_units(drive.units)
    model = mujoco.MjModel.from_xml_string(exported.text)
    joints = [model.joint(f"x{i}") for i in range(1, drive.carts + 1)]
    sample_time, found = 1e-3, []
    for case, u in trials(drive, sample_time).items():
        data = mujoco.MjData(model)
        rows = np.zeros((len(u), 4))
        for i, command in enumerate(u):
            for k, joint in enumerate(joints):
                rows[i, k] = data.qpos[joint.qposadr[0]]
            data.ctrl[0] = command / units.one("V")
            for _ in range(round(sample_time / TIMESTEP_S)):
                mujoco.mj_step(model, data)
        rows[:, :2] *= units.one("mm")
        # as an encoder's rate: what the rig would record
        rows[1:, 2:] = np.diff(rows[:, :2], axis=0) / sample_time
        run = drive.simulate(np.arange(len(u)) * sample_time, u)
        found += _compare(case, rows, run, drive.carts)
    return found


def verify_controller(
    controller: LinearController | Agent, drive: Drive, exported: Exported, name: str, to: str
) -> list[Difference]:
    """Let an exported controller answer to the readings of our closed loop, and compare its commands with ours.

    Parameters
    ----------
    controller
        That was exported, in the engine's units.
    drive
        On which it runs.
    exported
        Its file.
    name
        Of the function.
    to
        ``matlab`` (run in Octave) or ``c``.

    Raises
    ------
    Missing
        Without Octave or a C compiler.
    RuntimeError
        If either reports an error.
    """
    if isinstance(controller, Agent):
        columns, ours = _agent_run(controller, drive)
        unit = 1.0
    else:
        columns, ours = _linear_run(controller, drive)
        unit = drive.units.one("V")
    theirs = (_in_octave if to == "matlab" else _compiled)(columns, exported, name)
    return [_difference("handout trajectory", "u", "V", theirs * unit, ours * unit)]


def _linear_run(controller: LinearController, drive: Drive) -> tuple[FloatArray, FloatArray]:
    """Return xr, x1, x2 and u in the rig's units, of the same controller run on a drive by the compiled loop."""
    xr = _reference(controller.sample_time)
    run = drive.simulate_closed_loop(np.arange(len(xr)) * controller.sample_time, xr, controller)
    assert run.x1 is not None
    x2 = run.x1 if run.x2 is None else run.x2
    if drive.units.lab:
        return np.column_stack([xr, run.x1, x2]), run.u
    # the controller in the rig's units, fed with the readings in these
    own = in_units(controller, drive.units)
    columns = np.column_stack([xr, run.x1, x2]) / drive.units.one("mm")
    return columns, _replayed(own, columns)


def _replayed(controller: LinearController, columns: FloatArray) -> FloatArray:
    """Return the commands of a controller for given readings, summed in the order of the compiled loop."""
    assert controller.L is not None
    x, out = np.zeros(controller.order), np.empty(len(columns))
    shaped = controller.shape(columns[:, 0])
    A, B, C, D, L = controller.A, controller.B, controller.C, controller.D, controller.L

    def summed(first: FloatArray, y: FloatArray, row: FloatArray, more: float = 0.0) -> float:
        total = first[0] * y[0] + first[1] * y[1] + first[2] * y[2] + more
        for j in range(controller.order):
            total += row[j] * x[j]
        return float(total)

    for i, (xr, (_xr, x1, x2)) in enumerate(zip(shaped, columns, strict=True)):
        y = np.array([xr, x1, x2])
        u = summed(D[0], y, C[0])
        if controller.friction != 0.0:
            u += controller.friction * min(max(summed(D[1], y, C[1]) / controller.threshold, -1.0), 1.0)
        out[i] = min(max(u, -controller.limit), controller.limit)
        excess = out[i] - u
        x = np.array([summed(B[n], y, A[n], L[n] * excess) for n in range(controller.order)])
    return out


def _agent_run(agent: Agent, drive: Drive) -> tuple[FloatArray, FloatArray]:
    """Return xr, the reference ahead, x1, x2 and u at the agent's periods."""
    task = agent.made_for(drive)
    xr = _reference(task.control_period)
    controller: PolicyController = agent.controller(drive, task.control_period).following(xr)
    run = drive.simulate_closed_loop(np.arange(len(xr)) * task.control_period, xr, controller)
    assert run.x1 is not None
    last = len(xr) - 1
    preview = [xr[np.minimum(np.arange(len(xr)) + int(a), last)] for a in task.preview_periods]
    return np.column_stack([xr, *preview, run.x1, run.x1 if run.x2 is None else run.x2]), run.u


def _reference(sample_time: float) -> FloatArray:
    return sample_reference("handout", np.arange(round(2.0 / sample_time)) * sample_time)


def _in_octave(columns: FloatArray, exported: Exported, name: str) -> FloatArray:
    n = columns.shape[1]
    ahead = f"a(i, 2:{n - 2}), " if n > 3 else ""
    script = (
        f"a = dlmread('in.csv'); u = zeros(rows(a), 1); [~, s] = {name}();\n"
        f"for i = 1:rows(a), [u(i), s] = {name}(s, a(i, 1), {ahead}a(i, {n - 1}), a(i, {n})); end\n"
        "dlmwrite('out.csv', u, 'precision', '%.17g');"
    )
    with _folder({f"{name}.m": exported.text}) as folder:
        np.savetxt(folder / "in.csv", columns, delimiter=",", fmt="%.17g")
        octave(folder, script)
        return np.loadtxt(folder / "out.csv")


def _compiled(columns: FloatArray, exported: Exported, name: str) -> FloatArray:
    compiler = next((c for c in (os.environ.get("CC", ""), "cc", "gcc", "clang") if c and shutil.which(c)), None)
    if compiler is None:
        raise Missing("there is no C compiler (cc, gcc or clang) on this machine")
    n = columns.shape[1]
    main = fill("check.c.j2", name=name, ahead=n > 3, columns=["xr", *["ahead"] * (n - 3), "x1", "x2"])
    with _folder({f"{name}.c": exported.text, f"{name}.h": exported.header, "check_main.c": main}) as folder:
        strict = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O2"]
        _run([compiler, *strict, f"{name}.c", "check_main.c", "-o", "check_main", "-lm"], folder)
        text = "\n".join(" ".join(float(v).hex() for v in row) for row in columns)
        out = _run([str(folder / "check_main")], folder, text)
    return np.array([float.fromhex(line) for line in out.split()])


def octave(folder: Path, script: str) -> str:
    """Run a script in Octave; return what it printed.

    Raises
    ------
    Missing
        Without Octave.
    RuntimeError
        If Octave reports an error.
    """
    found = shutil.which("octave-cli") or shutil.which("octave")
    if found is None:
        raise Missing("octave is not on this machine; on Debian run: apt-get install octave octave-control")
    return _run([found, "--no-init-file", "--no-history", "--quiet", "--eval", script], folder)


def _run(command: Sequence[str], folder: Path, given: str = "") -> str:
    done = subprocess.run(  # noqa: S603
        command, cwd=folder, input=given, capture_output=True, text=True, check=False, timeout=_TIMEOUT_S
    )
    if done.returncode != 0:
        tail = (done.stderr or done.stdout).strip()[-600:]
        raise RuntimeError(f"{Path(command[0]).name}: ended with {done.returncode}: {tail}")
    return done.stdout


@contextmanager
def _folder(files: Mapping[str, str]) -> Iterator[Path]:
    with tempfile.TemporaryDirectory(prefix="flexdrive_") as name:
        folder = Path(name)
        for file, text in files.items():
            (folder / file).write_text(text, encoding="utf-8")
        yield folder

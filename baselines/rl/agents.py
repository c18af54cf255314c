"""Trained agents: a small network with the arguments of its task, in a file that cannot run code. Only numpy is needed.

An agent is a multilayer perceptron over the observation in physical units; whatever scaling served the training is folded
into its first layer. So an agent means the same on every drive: bounds that follow from a drive's friction are no part of it.

A policy file is a NumPy archive: the arrays ``W0``, ``b0``, ``W1``, … and one text, ``about``, with everything else as JSON.
It is read without pickles, and everything in it is checked before it is used.
"""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from difflib import get_close_matches
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from baselines.evaluation.adapters import PolicyController
from flexdrive_gym import Drive
from flexdrive_gym.files import write_atomically
from flexdrive_gym.recording import FloatArray
from flexdrive_gym.task import Task
from flexdrive_gym.units import Units

SCHEMA = 1
FOLDER = Path(__file__).parents[1] / "agents"
ACTIVATIONS: dict[str, Callable[[FloatArray], FloatArray]] = {"tanh": np.tanh, "relu": lambda x: np.maximum(x, 0.0)}
LARGEST_BYTES = 16_000_000
LONGEST_HISTORY = 64

Layers = Sequence[tuple[npt.ArrayLike, npt.ArrayLike]]


@dataclass(eq=False)
class Agent:
    """A trained policy.

    Parameters
    ----------
    name
        For tables.
    layers
        (W, b) of each layer, shapes (out, in) and (out,); the first takes the last ``history`` observations, newest first,
        the last gives the command over the voltage limit, which is clipped to -1 … 1.
    activation
        Between the layers: a key of :data:`ACTIVATIONS`.
    task
        Arguments of :class:`~flexdrive_gym.task.Task` that say what the agent sees and does, without drive and reference.
    history
        Observations it looks at, the present one included.
    card
        What a reader should know: command, seed, commit, drive, steps, score, versions.

    Raises
    ------
    ValueError
        If weights, activation, task and history do not fit together.
    """

    name: str
    layers: Layers = field(repr=False)
    activation: str
    task: Mapping[str, Any]
    history: int = 1
    card: Mapping[str, Any] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        if self.activation not in ACTIVATIONS:
            raise ValueError(f"activation: must be among {', '.join(ACTIVATIONS)}; got {self.activation!r}.")
        if not isinstance(self.history, int) or not 1 <= self.history <= LONGEST_HISTORY:
            raise ValueError(
                f"history: must be a whole number from 1 to {LONGEST_HISTORY}; got {self.history!r}. Train the agent again."
            )
        unsuitable = {"drive", "reference", "normalise", "randomise"} & set(self.task)
        if unsuitable:
            raise ValueError(
                f"task: says what the agent sees, so it must not hold {', '.join(sorted(unsuitable))}; got {dict(self.task)!r}. "
                "Leave them out: an agent sees physical units."
            )
        self.layers = _checked(self.layers, self.history * len(self.made_for().names()))
        self.reset()

    def made_for(self, drive: Drive | None = None) -> Task:
        """Return the agent's task on a drive; ``None`` for the documented default."""
        try:
            return Task(drive=drive, **self.task)
        except TypeError as error:
            raise ValueError(
                f"task: must be arguments of Task; got {dict(self.task)!r} ({error}). Train the agent again."
            ) from error

    def on_scale_of(self, drive: Drive) -> Agent:
        """Return the agent for another scale of its rig's units: what it sees and commands is the same on the rig.

        An agent of the lab's units runs as it is: any rig is brought to the lab's task.
        """
        made = self.card.get("units")
        units = drive.units
        if made is None or (made["length"], made["command"]) != (units.length, units.command):
            return self
        was = Units(**made)
        if was == units:
            return self
        names = [unit for _name, unit, _bound in self.made_for().names()] * self.history
        (W, b), *rest = self.layers
        # old numbers from new ones
        seen = np.array([was.one(unit) / units.one(unit) for unit in names])
        task = {**self.task, "voltage_limit": self.task["voltage_limit"] * units.one("V") / was.one("V")}
        card = {**self.card, "units": asdict(units)}
        return Agent(self.name, [(np.asarray(W) * seen, b), *rest], self.activation, task, self.history, card)

    def reset(self) -> None:
        """Forget the past."""
        self._past: FloatArray | None = None

    def __call__(self, observation: npt.ArrayLike) -> npt.NDArray[np.float32]:
        """Return the action, shape (1,), to the present observation, shape (entries,); earlier ones are remembered."""
        now = np.asarray(observation, dtype=np.float64)
        if self._past is None:
            self._past = np.tile(now, self.history)
        else:
            # rebound, not written into: a copy of the agent keeps its own past
            self._past = np.concatenate([now, self._past[: -len(now)]])
        action: npt.NDArray[np.float32] = self.act_many(self._past[None, :])[0]
        return action

    def act_many(self, observations: npt.ArrayLike) -> npt.NDArray[np.float32]:
        """Return actions without remembering anything.

        Parameters
        ----------
        observations : array_like, shape (n, history * entries)
            Each row the last observations, newest first, as ``FlexDriveVecEnv(n, history=agent.history, normalise=False,
            **agent.task)`` gives them.

        Returns
        -------
        ndarray, shape (n, 1)
        """
        x = np.asarray(observations, dtype=np.float64)
        bend = ACTIVATIONS[self.activation]
        *hidden, (W, b) = self._transposed
        for V, c in hidden:
            x = bend(x @ V + c)
        return np.asarray(np.clip(x @ W + b, -1.0, 1.0), dtype=np.float32)

    def controller(self, drive: Drive | None = None, sample_time: float = 1e-3) -> PolicyController:
        """Return the agent as a controller of the rig.

        Parameters
        ----------
        drive
            It will run on, which must have the carts that the agent reads; ``None`` for the documented default.
        sample_time
            How often it will be called [s]; it holds its command between its own samples.
        """
        return PolicyController(self, self.made_for(drive), sample_time)

    @cached_property
    def _transposed(self) -> list[tuple[FloatArray, FloatArray]]:
        return [(np.asarray(W).T.copy(), np.asarray(b)) for W, b in self.layers]


def _checked(layers: Layers, entries: int) -> list[tuple[FloatArray, FloatArray]]:
    """Return the layers as arrays that fit each other, the observation and the action."""
    if not layers:
        raise ValueError("layers: a policy needs at least one (W, b); got none. Train the agent again.")
    found, size = [], entries
    for i, (weights, bias) in enumerate(layers):
        W, b = np.asarray(weights, dtype=np.float64), np.asarray(bias, dtype=np.float64)
        if W.ndim != 2 or W.shape[1] != size or b.shape != W.shape[:1]:
            raise ValueError(
                f"W{i}: must have shape (n, {size}) and b{i} shape (n,); got {W.shape} and {b.shape}. "
                "The file belongs to another task, or is damaged: train the agent again."
            )
        if not (np.isfinite(W).all() and np.isfinite(b).all()):
            raise ValueError(f"W{i}: weights must be finite; got nan or inf. Train the agent again.")
        found.append((W, b))
        size = len(b)
    if size != 1:
        raise ValueError(f"W{len(found) - 1}: the last layer must give one command; got {size}. Train the agent again.")
    return found


def save_agent(agent: Agent, path: str | Path) -> Path:
    """Write a policy file (``.npz``) by way of a temporary neighbour."""
    about = {
        "schema": SCHEMA,
        "name": agent.name,
        "activation": agent.activation,
        "history": agent.history,
        "task": dict(agent.task),
        "card": dict(agent.card),
    }
    arrays: dict[str, Any] = {"about": np.array(json.dumps(about, ensure_ascii=False))}
    for i, (W, b) in enumerate(agent.layers):
        arrays |= {f"W{i}": np.asarray(W), f"b{i}": np.asarray(b)}
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    return write_atomically(path, stream.getvalue())


def load_agent(path: str | Path) -> Agent:
    """Read a policy file; nothing in it is run.

    Raises
    ------
    ValueError
        For anything that is no policy file of this or an earlier schema.
    OSError
        If the file cannot be read.
    """
    raw = Path(path).read_bytes()
    if not zipfile.is_zipfile(io.BytesIO(raw)):
        raise ValueError(f"path: must be a policy file (.npz); got {path}. Use what 'flexdrive train' wrote.")
    try:
        arrays = _unpacked(raw)
    except (ValueError, OSError, EOFError, KeyError, zipfile.BadZipFile) as error:
        raise ValueError(
            f"path: a policy file must hold plain arrays; got {path}: {error}. Use what 'flexdrive train' wrote."
        ) from error
    about = _about(arrays, path)
    layers: list[tuple[FloatArray, FloatArray]] = []
    while f"W{len(layers)}" in arrays:
        i = len(layers)
        layers.append((_numbers(arrays, f"W{i}", path), _numbers(arrays, f"b{i}", path)))
    unknown = set(arrays) - {"about"} - {f"{x}{i}" for x in "Wb" for i in range(len(layers))}
    if unknown:
        raise ValueError(
            f"path: must hold about, W0, b0, … without gaps; got {', '.join(sorted(unknown))} too in {path}. "
            "Use what 'flexdrive train' wrote."
        )
    try:
        return Agent(about["name"], layers, about["activation"], about["task"], about["history"], about["card"])
    except ValueError as error:
        raise ValueError(f"{error} (in {path})") from error


def _unpacked(raw: bytes) -> dict[str, npt.NDArray[Any]]:
    """Return the arrays of an archive that is no larger than a policy can be."""
    with zipfile.ZipFile(io.BytesIO(raw)) as archive:
        size = sum(item.file_size for item in archive.infolist())
    if size > LARGEST_BYTES:
        raise ValueError(f"it would take {size / 1e6:.0f} MB, more than {LARGEST_BYTES / 1e6:.0f} MB")
    with np.load(io.BytesIO(raw), allow_pickle=False) as arrays:
        return {name: arrays[name] for name in arrays.files}


def _about(arrays: Mapping[str, npt.NDArray[Any]], path: str | Path) -> dict[str, Any]:
    """Return the text of a policy file, checked."""
    text = arrays.get("about")
    if text is None or text.dtype.kind != "U" or text.ndim != 0:
        raise ValueError(
            f"about: a policy file must hold one text; got none in {path}. Use what 'flexdrive train' wrote."
        )
    try:
        about = json.loads(str(text))
    except json.JSONDecodeError as error:
        raise ValueError(f"about: must be JSON; got {error} in {path}. Use what 'flexdrive train' wrote.") from error
    schema = about.get("schema") if isinstance(about, dict) else None
    if not isinstance(schema, int) or not 1 <= schema <= SCHEMA:
        raise ValueError(
            f"schema: must be 1 … {SCHEMA}; got {schema!r} in {path}. Update flexdrive to read newer files."
        )
    kinds = {"name": str, "activation": str, "history": int, "task": dict, "card": dict}
    wrong = [key for key, kind in kinds.items() if not isinstance(about.get(key), kind)]
    if wrong:
        key = wrong[0]
        raise ValueError(
            f"{key}: must be {kinds[key].__name__}; got {about.get(key)!r} in {path}. Use what 'flexdrive train' wrote."
        )
    return dict(about)


def _numbers(arrays: Mapping[str, npt.NDArray[Any]], name: str, path: str | Path) -> npt.NDArray[Any]:
    values = arrays.get(name)
    if values is None or values.dtype.kind != "f":
        kind = "nothing" if values is None else f"an array of {values.dtype}"
        raise ValueError(f"{name}: must be an array of real numbers; got {kind} in {path}. Train the agent again.")
    return values


def agent_names() -> tuple[str, ...]:
    """Return the names of the ready-trained agents."""
    return tuple(sorted(path.stem for path in FOLDER.glob("*.npz")))


def find_agent(name: str) -> Agent:
    """Return a ready-trained agent by name.

    Raises
    ------
    ValueError
        For an unknown name, with the near match.
    """
    names = agent_names()
    if name not in names:
        near = get_close_matches(name, names, n=1)
        hint = f"Did you mean {near[0]!r}?" if near else "Read a file with load_agent."
        raise ValueError(f"name: must be among {', '.join(names) or 'no agents'}; got {name!r}. {hint}")
    return load_agent(FOLDER / f"{name}.npz")

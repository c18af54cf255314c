"""A training in a file: tensors, plain numbers and text, so that reading it cannot run code.

A snapshot is taken between rollouts, where nothing is under way. It holds all that the future depends on, the drives and the
states of the random generators too, so a resumed training does bit by bit what an uninterrupted one does.
"""

from __future__ import annotations

import io
import pickle
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO

from baselines.rl.vec_env import FlexDriveVecEnv
from flexdrive_gym.files import write_atomically

SCHEMA = 1


def snapshot(model: PPO, env: FlexDriveVecEnv, about: dict[str, Any]) -> dict[str, Any]:
    """Return a training as tensors, numbers and text; ``about`` holds more of these."""
    generator = np.random.get_state(legacy=False)  # noqa: NPY002  (SB3 shuffles by the global one)
    assert isinstance(generator, dict)
    last, starts = model._last_obs, model._last_episode_starts
    return {
        "schema": SCHEMA,
        "steps": int(model.num_timesteps),
        "updates": int(model._n_updates),
        "policy": {k: v.clone() for k, v in model.policy.state_dict().items()},
        "optimizer": _copied(model.policy.optimizer.state_dict()),
        "drives": {k: _tensor(v) for k, v in env.keep().items()},
        "last_observation": torch.as_tensor(np.array(last)),
        "last_starts": torch.as_tensor(np.array(starts)),
        "torch_generator": torch.get_rng_state(),
        "numpy_generator": torch.as_tensor(generator["state"]["key"].astype(np.int64)),
        "numpy_position": int(generator["state"]["pos"]),
        **about,
    }


def restore(model: PPO, env: FlexDriveVecEnv, saved: dict[str, Any]) -> None:
    """Put a training where its snapshot was taken."""
    model.policy.load_state_dict(saved["policy"])
    model.policy.optimizer.load_state_dict(saved["optimizer"])
    model.num_timesteps, model._n_updates = saved["steps"], saved["updates"]
    env.restore({k: _array(v, env.keep()[k]) for k, v in saved["drives"].items()})
    model._last_obs = saved["last_observation"].numpy().copy()
    model._last_episode_starts = saved["last_starts"].numpy().copy()
    torch.set_rng_state(saved["torch_generator"])
    generator = np.random.get_state(legacy=False)  # noqa: NPY002
    assert isinstance(generator, dict)
    generator["state"] = {"key": saved["numpy_generator"].numpy().astype(np.uint32), "pos": saved["numpy_position"]}
    generator["has_gauss"] = 0
    np.random.set_state(generator)  # noqa: NPY002


def write_checkpoint(saved: dict[str, Any], path: Path) -> Path:
    """Write a snapshot by way of a temporary neighbour."""
    stream = io.BytesIO()
    torch.save(saved, stream)
    return write_atomically(path, stream.getvalue())


def read_checkpoint(path: Path) -> dict[str, Any]:
    """Read a snapshot; nothing in it is run.

    Raises
    ------
    ValueError
        If it is no checkpoint of this or an earlier schema.
    """
    try:
        saved = torch.load(path, map_location="cpu", weights_only=True)
    except (pickle.UnpicklingError, RuntimeError, EOFError, ValueError, KeyError, zipfile.BadZipFile) as error:
        raise ValueError(
            f"checkpoint: must be a checkpoint of flexdrive; got {path}. Train again without --resume."
        ) from error
    schema = saved.get("schema") if isinstance(saved, dict) else None
    if not isinstance(schema, int) or not 1 <= schema <= SCHEMA:
        raise ValueError(f"checkpoint: schema must be 1 … {SCHEMA}; got {schema!r} in {path}. Update flexdrive.")
    return dict(saved)


def _copied(value: Any) -> Any:
    if isinstance(value, torch.Tensor):
        return value.clone()
    if isinstance(value, dict):
        return {k: _copied(v) for k, v in value.items()}
    return [_copied(v) for v in value] if isinstance(value, list | tuple) else value


def _tensor(array: np.ndarray) -> torch.Tensor:
    # torch keeps few unsigned kinds; the bits are what matters
    return torch.as_tensor(array.view(np.int64) if array.dtype == np.uint64 else array)


def _array(tensor: torch.Tensor, like: np.ndarray) -> np.ndarray:
    array = tensor.numpy()
    found = array.view(np.uint64) if like.dtype == np.uint64 else array
    if found.shape != like.shape or found.dtype != like.dtype:
        raise ValueError(
            f"checkpoint: the drives must have arrays of {like.dtype} and shape {like.shape}; got {found.dtype} and "
            f"{found.shape}. Train again without --resume."
        )
    return np.asarray(found)

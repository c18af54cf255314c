"""A visitor's own controller: data, never code."""

from __future__ import annotations

import tempfile
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

from baselines.lab_page import texts
from flexdrive_gym import Controller, Drive

# where LinearController in TOML is read, once it is: a module with loads(text, where) -> LinearController
TOML_READER = "flexdrive_gym.drive.controller_toml"
LARGEST_BYTES = 16_000_000
RIG_TIME_S = 1e-3


def read_controller(name: str, content: bytes, drive: Drive) -> Controller:
    """Read a controller from a file's name and content; nothing in it is run.

    Raises
    ------
    ValueError
        For a file that is too large, or no controller.
    """
    if len(content) > LARGEST_BYTES:
        raise ValueError(f"controller: at most {LARGEST_BYTES // 1_000_000} MB are read; got {len(content)} bytes.")
    if name.lower().endswith(".npz"):
        from baselines.rl.agents import load_agent  # noqa: PLC0415  (reads files)

        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "agent.npz"
            path.write_bytes(content)
            return load_agent(path).controller(drive, RIG_TIME_S)
    if find_spec(TOML_READER) is None:
        raise ValueError(texts.NO_CONTROLLER_FORMAT)
    try:
        text = content.decode("utf-8")
    except UnicodeDecodeError as error:
        raise ValueError(f"controller: must be UTF-8 text; got {error}.") from error
    found: Controller = import_module(TOML_READER).loads(text, name)
    return found

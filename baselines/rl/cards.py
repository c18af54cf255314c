"""The card of an agent as a text that people read: how it was made, on what, and how well it does."""

from __future__ import annotations

from pathlib import Path

import tomlkit

from baselines.rl.agents import Agent
from flexdrive_gym.files import write_atomically


def command(agent: Agent) -> str:
    """Return the command that trains the agent."""
    plan = agent.card["plan"]
    options = " ".join(f"--{name} {value}" for name, value in plan.items())
    return f"flexdrive train {options}"


def write_card(agent: Agent, path: Path) -> Path:
    """Write the card beside the policy file."""
    document = tomlkit.document()
    document.add("name", tomlkit.item(agent.name))
    document.add("command", tomlkit.item(command(agent)))
    for key, value in agent.card.items():
        document.add(key, tomlkit.item(value))
    document.add("task", tomlkit.item(dict(agent.task)))
    return write_atomically(path, tomlkit.dumps(document))

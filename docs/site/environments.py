"""``python -m docs.site.environments`` writes docs/environments: a page of every id in Gymnasium's form."""

import inspect
import re
from dataclasses import MISSING, fields
from pathlib import Path

import gymnasium

import flexdrive_gym  # noqa: F401  (registers the environments)
from docs.site.rst import markdown
from flexdrive_gym.files import write_atomically
from flexdrive_gym.references import REFERENCES
from flexdrive_gym.task import DEFAULT_REWARD, ERROR_SCALE_MM, Task

FOLDER = Path(__file__).parents[1] / "environments"
IDS = {
    "FlexDrive-NonCollocated-v0": "The controller sees the encoder of cart 2, beyond the spring. Feedback is not collocated: the "
    "spring lies between force and sensor, so the gain that keeps a loop stable is bounded.",
    "FlexDrive-Collocated-v0": "The controller sees the encoder of cart 1, where the force acts. The task is still the "
    "position of cart 2.",
    "FlexDrive-FullState-v0": "The controller sees both encoders.",
}
# newest first; a change of spaces, reward, ends or dynamics of the default task is a new version
HISTORY = dict.fromkeys(IDS, ("v0: first version.",))
_WORDS = {
    "x1": "position of cart 1, as the encoder counts",
    "x2": "position of cart 2, as the encoder counts",
    "v1": "velocity of cart 1, filtered difference over the control period",
    "v2": "velocity of cart 2, filtered difference over the control period",
    "xr": "reference now",
    "last u": "last command",
}


def _arguments() -> dict[str, str]:
    """Return what the docstring says of every argument; arguments that share a paragraph share its text."""
    text = inspect.cleandoc(Task.__doc__ or "").split("Parameters\n----------\n")[1]
    found = {}
    for names, said in re.findall(r"^([\w, ]+)\n((?: +.*\n?)+)", text, re.MULTILINE):
        for name in names.split(", "):
            found[name] = " ".join(markdown(said).split()).replace("``", "`").replace("|", r"\|")
    return found


def _default(name: str) -> str:
    given = next(f for f in fields(Task) if f.name == name).default
    return "" if given is MISSING else f"`{given!r}`"


def page(id_: str) -> str:
    """Return an id's page as Markdown."""
    env = gymnasium.make(id_)
    task = env.unwrapped.task  # type: ignore[attr-defined]
    low, high = env.observation_space.low, env.observation_space.high  # type: ignore[attr-defined]
    entries = [
        f"| {i} | {_WORDS.get(name, 'reference ahead' if name.startswith('xr in') else 'tracking error, as it is seen')} | "
        f"`{name}` | {lo:g} | {hi:g} | {unit} |"
        for i, ((name, unit, _bound), lo, hi) in enumerate(zip(task.names(), low, high, strict=True))
    ]
    said = _arguments()
    arguments = [
        f"| `{f.name}` | {_default(f.name)} | {said[f.name]} |" for f in fields(Task) if f.init and f.name != "sensing"
    ]
    w, least, most = DEFAULT_REWARD, env.action_space.low[0], env.action_space.high[0]  # type: ignore[attr-defined]
    tracking = "" if w["tracking"] == 1.0 else f"{w['tracking']:g} "
    return f"""# {id_}

{IDS[id_]}

| | |
|---|---|
| Action space | `{env.action_space}` |
| Observation space | `Box({low.min():g}, {high.max():g}, {low.shape}, {low.dtype})` |
| Time limit | {task.horizon} steps of {1e3 * task.control_period:g} ms |
| Made by | `gymnasium.make("{id_}")` |

## Description

Two carts on a rail are joined by a spring. A motor drives cart 1. Both carts have dry and viscous friction. The task is to
bring cart 2 along a reference. Without `drive=` the rig is the laboratory rig of winter 2022; `drive="drive.toml"` takes one
that `flexdrive identify` wrote.

## Action space

| Num | Action | Min | Max |
|---|---|---|---|
| 0 | command over the voltage limit ({task.voltage:g} V), held for a control period | {least:g} | {most:g} |

An action that is not a finite number raises `ValueError`; the drive has not moved then.

## Observation space

| Num | Observation | Name | Min | Max | Unit |
|---|---|---|---|---|---|
{chr(10).join(entries)}

With `normalise=True` every entry is divided by its bound. `info` has the true state, the readings, the reference, the error and
every term of the reward in physical units.

## Rewards

*r = −{tracking}(e / {ERROR_SCALE_MM:g} mm)² − {w["effort"]:g} (u / limit)² − {w["rate"]:g} (Δu / limit)²*,
and −{w["failure"]:g} once on failure; *e = xr − x2* is the true error. `reward={{"effort": 0.1}}` changes a weight.

## Starting state

At rest at 0. `reset(options={{"x1": 10.0, "v2": -5.0}})` starts elsewhere; what is not named is 0. `randomise=` draws the
drive's parameters at every reset.

## Episode end

- *Terminated* when a cart leaves ±{task.travel_limit:g} mm or the spring ±{task.stroke_limit:g} mm.
- *Truncated* after {task.duration:g} s. Never both. A time limit is no failure.

A step before the first reset or after the end raises `gymnasium.error.ResetNeeded`.

## Arguments

`gymnasium.make("{id_}", render_mode=..., drive=..., ...)`; `render_mode` is `human`, `rgb_array`, `ansi` or `None`.
References by name: {", ".join(f"`{name}`" for name in REFERENCES)}.

| Argument | Default | Meaning |
|---|---|---|
{chr(10).join(arguments)}

`gymnasium.make_vec("{id_}", num_envs=1024, vectorization_mode="vector_entry_point")` is one compiled call a step
([batches](../environment.md)).

## Version history

{chr(10).join(f"- {line}" for line in HISTORY[id_])}

The rule for new versions is on the page about [compatibility](../compatibility.md).

Written by `python -m docs.site.environments`.
"""


if __name__ == "__main__":
    for name in IDS:
        write_atomically(FOLDER / f"{name}.md", page(name))

"""Controllers and agents in C99 and Octave give the bits of our own run."""

import shutil

import numpy as np
import pytest

from baselines.controllers import FAMILIES, design
from baselines.export import arithmetic, export_agent, export_linear, verify_controller
from baselines.rl.agents import Agent, agent_names, find_agent
from flexdrive_gym import DEFAULT_DRIVE, Drive, LinearController
from flexdrive_gym.units import Units
from tests.each import each

COMPILER = pytest.mark.skipif(not (shutil.which("cc") or shutil.which("gcc")), reason="no C compiler on this machine")
OCTAVE = pytest.mark.skipif(
    not (shutil.which("octave-cli") or shutil.which("octave")),
    reason="no octave on this machine: apt-get install octave",
)
TOOLS = [pytest.param("c", marks=COMPILER), pytest.param("matlab", marks=OCTAVE)]
ROTARY = Drive(dict(DEFAULT_DRIVE.values), units=Units("rad", "N m", 123.0, 7.0, 1.7))


def same_bits(controller, drive, to):
    if isinstance(controller, Agent):
        exported = export_agent(controller, "controller", to, drive=drive)
    else:
        exported = export_linear(controller, "controller", to, units=drive.units)
    (found,) = verify_controller(controller, drive, exported, "controller", to)
    assert found.peak > 0.0
    assert found.equal == found.samples
    return exported


# designs that search take their time
QUICK = {"p_x2", "lab4", "lqg"}


@COMPILER
@pytest.mark.parametrize("name", [n if n in QUICK else pytest.param(n, marks=pytest.mark.slow) for n in FAMILIES])
def test_every_family_in_c(name):
    same_bits(design(name, DEFAULT_DRIVE).controller, DEFAULT_DRIVE, "c")


@pytest.mark.parametrize("to", TOOLS)
def test_friction_compensation_and_shaper(to):
    # order 1, friction, a shaper that remembers, an own limit: all that the law has
    law = LinearController(
        [[0.99]], [[0.01, 0.0, -0.01]], [[0.5], [0.1]], [[0.2, -0.01, -0.19], [1.0, 0.0, -1.0]], L=[0.1], limit=1.5, friction=0.3,
        threshold=20.0, shaper=((0, 0.5), (25, 0.3), (60, 0.2)),
    )  # fmt: skip
    same_bits(law, DEFAULT_DRIVE, to)


@pytest.mark.parametrize("to", TOOLS)
def test_a_rig_in_its_own_units(to):
    text = same_bits(design("lqg", ROTARY).controller, ROTARY, to).text
    assert "xr, x1, x2 in rad, u in N m" in text


@pytest.mark.parametrize("to", TOOLS)
@each("name", ["x1-0", "x2-0"])
def test_an_agent(name, to):
    assert name in agent_names()
    same_bits(find_agent(name), DEFAULT_DRIVE, to)


@pytest.mark.parametrize("to", TOOLS)
def test_another_network(to):
    rng = np.random.default_rng(3)
    # both encoders: x1, v1, x2, v2, error, xr, last u and one value ahead
    layers = [(0.02 * rng.normal(size=(5, 8)), rng.normal(size=5)), (rng.normal(size=(1, 5)), np.zeros(1))]
    same_bits(Agent("relu", layers, "relu", {"sensing": "full_state", "preview": (0.02,)}), DEFAULT_DRIVE, to)


def test_the_tangent_is_the_librarys_to_some_last_bits():
    x = np.concatenate([np.linspace(-22.0, 22.0, 20_001), np.geomspace(1e-300, 1.0, 5_000), [0.0, -0.0, 1e308, -1e308]])
    exact = np.tanh(x.astype(np.longdouble))
    assert np.max(np.abs(arithmetic.tanh(x) - exact) / np.spacing(np.maximum(np.abs(np.tanh(x)), 1e-307))) < 4.0


@each("name", agent_names())
def test_the_written_out_network_acts_as_the_agent(name):
    agent = find_agent(name)
    seen = (
        np.random.default_rng(0).normal(size=(500, agent.history * len(agent.made_for().names()))).astype(np.float32)
        * 20.0
    )
    ours = np.clip(arithmetic.network(agent, seen), -1.0, 1.0).astype(np.float32)
    assert np.array_equal(ours, agent.act_many(seen)[:, 0])

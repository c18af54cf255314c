"""The page on agents says what their cards say."""

import re
import tomllib
from pathlib import Path

import pytest

from baselines.rl.agents import FOLDER, agent_names, find_agent
from tests.each import each

PAGE = Path(__file__).parents[2] / "docs" / "agents.md"


def test_five_seeds_for_each_encoder_in_five_megabytes():
    assert agent_names() == tuple(f"{feedback}-{seed}" for feedback in ("x1", "x2") for seed in range(5))
    assert sum(path.stat().st_size for path in FOLDER.iterdir()) < 5e6


@each("name", agent_names())
def test_file_card_and_page_agree(name):
    card = tomllib.loads((FOLDER / f"{name}.toml").read_text(encoding="utf-8"))
    agent = find_agent(name)
    for key, value in agent.card.items():
        assert card[key] == value
    assert card["command"].startswith(f"flexdrive train --feedback {name[:2]} --seed {name[-1]} ")
    row = next(line for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith(f"| {name} |"))
    score = card["score"]
    said = [float(x) for x in re.findall(r"[\d.]+", row.split("|", 2)[2])][:3]
    assert said == [round(score[k], 2) for k in ("rms_mm_handout", "peak_mm_handout", "rms_mm_unseen_references")]


def test_on_the_rig_an_agent_does_what_its_card_says():
    pytest.importorskip("stable_baselines3", reason="needs the extra rl")
    from baselines.rl.evaluation import on_the_handout
    from flexdrive_gym import DEFAULT_DRIVE

    agent = find_agent("x2-0")
    assert on_the_handout(agent, DEFAULT_DRIVE).rms == pytest.approx(agent.card["score"]["rms_mm_handout"], abs=0.01)

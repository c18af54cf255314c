"""A step's info is a dictionary to whoever looks, whenever they look."""

import copy
import json
import pickle

import gymnasium
import numpy as np

from flexdrive_gym.fleet import KEYS
from tests.each import each

ID = "FlexDrive-NonCollocated-v0"


def keywords(**named):
    return named


WAYS = {
    "dict": dict,
    "display": lambda i: {**i},
    "call": lambda i: keywords(**i),
    "or": lambda i: i | {},
    "ror": lambda i: {} | i,
    "copy": lambda i: i.copy(),
    "shallow": copy.copy,
    "deep": copy.deepcopy,
    "pickle": lambda i: pickle.loads(pickle.dumps(i)),
    "json": lambda i: json.loads(json.dumps(i)),
    "json, indented": lambda i: json.loads(json.dumps(i, indent=1)),
    "items": lambda i: dict(i.items()),
    "values": lambda i: dict(zip(list(i), i.values(), strict=True)),
    "get": lambda i: {k: i.get(k) for k in KEYS},
    "subscript": lambda i: {k: i[k] for k in KEYS},
    "printed": lambda i: eval(str(i)),
    "own type": lambda i: type(i)(i),
    "equal": lambda i: i if i == dict(i) and dict(i) == i else {},
}


def trace(steps=8):
    """Observations, infos not looked at yet, and what they must say: another environment's, read at once."""
    env, twin = gymnasium.make(ID), gymnasium.make(ID)
    env.reset(seed=0)
    twin.reset(seed=0)
    infos, expected = [], []
    for k in range(steps):
        action = np.array([0.1 * k], np.float32)
        infos.append(env.step(action)[4])
        expected.append({key: float(value) for key, value in twin.step(action)[4].items()})
    return infos, expected


@each("way", WAYS)
def test_every_way_of_reading_sees_all(way):
    infos, expected = trace(3)
    found = [WAYS[way](info) for info in infos]
    assert found == expected
    assert list(found[0]) == list(KEYS)


def test_it_tells_about_its_own_step_however_late_it_is_read():
    infos, expected = trace(20)
    assert [dict(info) for info in infos] == expected


def test_it_is_a_dictionary():
    infos, expected = trace(6)
    assert all(isinstance(info, dict) for info in infos)
    assert len(infos[0]) == len(KEYS)
    assert "xr" in infos[1]
    assert list(reversed(infos[2])) == list(reversed(KEYS))
    infos[3]["x1"] = 7.0  # as wrappers do
    infos[3].update(episode=1)
    assert infos[3] == expected[3] | {"x1": 7.0, "episode": 1}
    assert infos[4].pop("u") == expected[4]["u"]
    assert "u" not in infos[4]
    del infos[5]["u"]
    assert "u" not in infos[5]
    match trace(1)[0][0]:
        case {"e": error}:
            assert error == expected[0]["e"]

"""Whatever a step hands out stays as it was, whoever keeps it and by whichever route."""

import queue
import threading
from collections import deque
from functools import partial
from importlib import import_module
from importlib.util import find_spec

import gymnasium
import numpy as np
import pytest

from flexdrive_gym import environment, fleet
from tests.each import each

ID = "FlexDrive-NonCollocated-v0"
STEPS = 40


class CopyOnWrite(gymnasium.Wrapper):
    """Hands the environment's info on, and an own one where it adds something."""

    def step(self, action):
        observation, reward, terminated, truncated, info = self.env.step(action)
        return observation, reward, terminated, truncated, {**info, "mine": 1} if info["u"] > 0.2 else info


ARRAYS = {
    "itself": lambda o: o,
    "a view": lambda o: o[1:],
    "a reversed view": lambda o: o[::-1],
    "np.asarray": np.asarray,
    "a reinterpreted view": lambda o: o.view(np.uint32),
    "memoryview": memoryview,
    "its buffer": lambda o: np.frombuffer(o.data, np.float32),
}
if find_spec("torch"):  # Python 3.12 and 3.13 are tried without
    ARRAYS["torch"] = lambda o: import_module("torch").from_numpy(o)


def bits(kept):
    return np.asarray(kept).tobytes()


@each("route", ARRAYS)
@pytest.mark.parametrize("num_envs", [0, 3, 300])
def test_observations(route, num_envs):
    batch = {"num_envs": num_envs, "vectorization_mode": "vector_entry_point"}
    env = gymnasium.make_vec(ID, **batch) if num_envs else gymnasium.make(ID)
    kept, then = [], []
    for k in range(STEPS):
        observation = (
            env.step(np.full((num_envs, 1) if num_envs else 1, 0.02 * k, np.float32))[0] if k else env.reset(seed=0)[0]
        )
        if k % 3 != 1:  # some are dropped, so that something could be used again
            kept.append(ARRAYS[route](observation))
            then.append(bits(kept[-1]))
        del observation
    assert [bits(x) for x in kept] == then


@each("num_envs", [3, 300])
def test_rewards_and_flags_of_a_batch(num_envs):
    env = gymnasium.make_vec(ID, num_envs=num_envs, vectorization_mode="vector_entry_point", duration=0.1)
    env.reset(seed=0)
    kept, then = [], []
    for k in range(STEPS):
        kept.append(env.step(np.full((num_envs, 1), 0.02 * k, np.float32))[1:4])
        then.append([bits(x) for x in kept[-1]])
    assert [[bits(x) for x in step] for step in kept] == then
    assert any(np.asarray(truncated).any() for _r, _t, truncated in kept)


def in_a_thread(infos):
    """Another thread keeps what it gets in variables of its own until all steps are over."""
    given, back = queue.SimpleQueue(), queue.SimpleQueue()

    def keep():
        mine = []
        while (info := given.get()) is not None:
            mine.append(info)
        for info in mine:
            back.put(dict(info))

    thread = threading.Thread(target=keep)
    thread.start()
    for info in infos:
        given.put(info)
        del info
    given.put(None)
    thread.join()
    return [back.get() for _ in range(back.qsize())]


def in_generators(infos):
    """Every info is only a local variable of a frame that waits."""

    def waiting(info):
        yield
        yield dict(info)

    frames = []
    for info in infos:
        frames.append(waiting(info))
        next(frames[-1])
        del info
    return [next(frame) for frame in frames]


def in_transitions(infos):
    """A replay buffer's tuples, in a deque."""
    buffer = deque(maxlen=10_000)
    for info in infos:
        buffer.append((0.0, info))
        del info
    return [dict(info) for _, info in buffer]


def in_closures(infos):
    return [kept() for kept in [partial(dict, info) for info in infos]]


def in_attributes(infos):
    class Holder:
        __slots__ = ("info",)

    holders = []
    for info in infos:
        holder = Holder()
        holder.info = info
        holders.append(holder)
        del info, holder
    return [dict(holder.info) for holder in holders]


ROUTES = {
    "a list": lambda infos: [dict(i) for i in list(infos)],
    "the values of a dictionary": lambda infos: [dict(i) for i in dict(enumerate(infos)).values()],
    "transitions": in_transitions,
    "a thread": in_a_thread,
    "generators": in_generators,
    "closures": in_closures,
    "attributes": in_attributes,
}


@each("route", ROUTES)
@pytest.mark.parametrize("wrapped", [False, True], ids=["bare", "copy on write"])
def test_infos_that_nobody_has_read_yet(route, wrapped):
    """Each is read only after all steps, and tells of its own step what another environment told at once."""
    env, twin = gymnasium.make(ID), gymnasium.make(ID)
    env.reset(seed=0)
    twin.reset(seed=0)
    env = CopyOnWrite(env) if wrapped else env
    expected = []

    def infos():
        for k in range(STEPS):
            action = np.array([np.sin(0.3 * k)], np.float32)
            info = env.step(action)[4]
            told = dict(twin.step(action)[4])
            if k % 3 != 1:
                expected.append(told)
                yield info
            del info

    found = ROUTES[route](infos())
    assert [{k: v for k, v in info.items() if k != "mine"} for info in found] == expected


def test_where_references_are_not_counted_nothing_is_used_again(monkeypatch):
    monkeypatch.setattr(fleet, "counts_references", lambda: False)
    monkeypatch.setattr(environment, "counts_references", lambda: False)
    env, batch = gymnasium.make(ID), gymnasium.make_vec(ID, num_envs=3, vectorization_mode="vector_entry_point")
    env.reset(seed=0)
    batch.reset(seed=0)
    slots, outputs = set(), set()
    for _ in range(3):
        env.step(np.zeros(1, np.float32))
        batch.step(np.zeros((3, 1), np.float32))
        slots.add(env.unwrapped._slots[0])
        outputs.add(batch.unwrapped.fleet.outputs)
    assert len(slots) == len(outputs) == 3


def test_this_interpreter_counts_references():
    assert fleet.counts_references()

"""The single environment: Gymnasium's contract and the handout's physics."""

import pickle
import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env
from hypothesis import given, settings
from hypothesis import strategies as st

from baselines.loop_analysis.stability_limit import critical_gain
from flexdrive_gym import DEFAULT_DRIVE, Covariance, Drive, PControl, save_drive
from flexdrive_gym.environment import FlexDriveEnv
from flexdrive_gym.fleet import KEYS
from flexdrive_gym.references import point_to_point
from tests.drive.drives import RIG
from tests.each import each

IDS = [f"FlexDrive-{name}-v0" for name in ("Collocated", "NonCollocated", "FullState")]
NON_COLLOCATED = IDS[1]


def rollout(env, steps=50, seed=3):
    rng = np.random.default_rng(seed)
    trace = [env.reset(seed=seed)[0]]
    for _ in range(steps):
        observation, reward, terminated, truncated, _info = env.step(rng.uniform(-1, 1, 1).astype(np.float32))
        trace += [observation, [reward, terminated, truncated]]
    return np.concatenate([np.ravel(x) for x in trace])


@each("name", IDS)
@each("normalise", [False, True])
def test_gymnasiums_check_finds_nothing(name, normalise):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gymnasium.make(name, normalise=normalise).unwrapped, skip_render_check=True)


@each("name", IDS)
def test_stable_baselines_check_finds_nothing(name):
    checker = pytest.importorskip("stable_baselines3.common.env_checker", reason="needs the extra rl")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # SB3 asks for a normalised observation space
        checker.check_env(gymnasium.make(name, normalise=True), warn=True, skip_render_check=True)


def test_imports_none_of_the_heavy_libraries():
    import subprocess
    import sys

    heavy = "('torch', 'stable_baselines3', 'control', 'matplotlib')"
    code = f"import sys, flexdrive_gym; print([m for m in {heavy} if m in sys.modules])"
    assert (
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip() == "[]"
    )


@each("name", IDS)
def test_same_seed_same_episode(name):
    arguments = {"noise": 0.01, "reference": "random_moves", "randomise": {"m1": (6e-4, 9e-4), "d1": (0.2, 0.5)}}
    a, b = (gymnasium.make(name, **arguments) for _ in range(2))
    assert np.array_equal(rollout(a), rollout(b))
    assert not np.array_equal(rollout(a, seed=3), rollout(a, seed=4))


def test_pickling_keeps_the_episode():
    env = gymnasium.make(NON_COLLOCATED, noise=0.01).unwrapped
    rollout(env, 20)
    twin = pickle.loads(pickle.dumps(env))
    action = np.array([0.3], np.float32)
    for _ in range(20):
        a, b = env.step(action), twin.step(action)
        assert np.array_equal(a[0], b[0])
        assert a[1:4] == b[1:4]


def test_it_is_the_drive_that_was_identified(tmp_path):
    path = save_drive(Drive({**RIG, "saturation.limit": 6.0}), tmp_path / "drive.toml")
    env = gymnasium.make(NON_COLLOCATED, drive=path).unwrapped
    assert env.drive["m1"] == RIG["m1"]
    assert env.task.voltage == 6.0
    assert env.linear_model().omega_n == pytest.approx(Drive(RIG).linear.omega_n)


def test_states_are_those_of_the_simulation():
    env = gymnasium.make(IDS[2]).unwrapped
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    commands = np.repeat(np.round(rng.uniform(-1, 1, 100), 3), 5)
    states = []
    for u in commands[::5]:
        info = env.step(np.array([u], np.float32))[4]
        states.append([info["x1"], info["x2"]])
    drive = DEFAULT_DRIVE.replace({f"encoder_quantisation.encoder_{i}.quantum": 0.0 for i in (1, 2)})
    t = np.arange(501) * 1e-3
    run = drive.simulate(t, np.append(np.float32(commands).astype(float) * 8.0, 0.0))
    assert np.allclose(np.array(states), np.column_stack([run.x1, run.x2])[5::5], atol=1e-6)


def test_reward_is_the_sum_of_its_terms_and_they_are_what_is_documented():
    env = gymnasium.make(NON_COLLOCATED, reward={"effort": 0.5}).unwrapped
    env.reset(seed=0)
    env.step(np.array([0.2], np.float32))
    _o, reward, _t, _c, info = env.step(np.array([0.5], np.float32))
    assert list(info) == list(KEYS)
    assert reward == pytest.approx(sum(v for k, v in info.items() if k.startswith("reward_")))
    assert info["reward_tracking"] == pytest.approx(-(((info["xr"] - info["x2"]) / 10.0) ** 2))
    assert info["reward_effort"] == pytest.approx(-0.5 * 0.5**2)
    assert info["reward_rate"] == pytest.approx(-0.01 * 0.3**2, rel=1e-5)


def test_time_limit_truncates_and_leaving_the_travel_terminates():
    env = gymnasium.make(NON_COLLOCATED, duration=0.1)
    env.reset(seed=0)
    ends = [env.step(np.zeros(1, np.float32))[2:4] for _ in range(20)]
    assert ends[-1] == (False, True)
    assert not any(a or b for a, b in ends[:-1])
    env = gymnasium.make(NON_COLLOCATED, travel_limit=60.0)
    env.reset(seed=0)
    for _ in range(400):
        _o, _r, terminated, truncated, info = env.step(np.ones(1, np.float32))
        if terminated:
            break
    assert (terminated, truncated) == (True, False)
    assert max(abs(info["x1"]), abs(info["x2"])) > 60.0
    assert info["reward_failure"] == -100.0


@each("control_period", [5e-3, 20e-3])
def test_a_drive_that_runs_away_terminates_with_numbers(control_period):
    # a spring that pushes throws the carts past all numbers within one control period
    env = gymnasium.make(NON_COLLOCATED, effects={"hardening_spring.k3": -1e-2}, control_period=control_period)
    env.reset(seed=0)
    for _ in range(40):
        observation, reward, terminated, _truncated, _i = env.step(np.ones(1, np.float32))
        assert env.observation_space.contains(observation)
        assert np.isfinite(reward)
        if terminated:
            return
    pytest.fail("the episode goes on")


def test_spring_stroke_terminates():
    env = gymnasium.make(NON_COLLOCATED, stroke_limit=5.0)
    env.reset(seed=0)
    for _ in range(400):
        _o, _r, terminated, _t, info = env.step(np.ones(1, np.float32))
        if terminated:
            break
    assert abs(info["x1"] - info["x2"]) > 5.0


def test_observations_stay_inside_the_space():
    env = gymnasium.make(IDS[2], noise=5.0, normalise=True)
    env.reset(seed=1)
    rng = np.random.default_rng(1)
    for _ in range(300):
        observation, _r, terminated, truncated, _i = env.step(rng.choice([-1.0, 1.0], 1).astype(np.float32))
        assert env.observation_space.contains(observation)
        if terminated or truncated:
            env.reset()


def test_controller_sees_encoders_not_truth():
    env = gymnasium.make(NON_COLLOCATED, quantum=0.5, velocity_cutoff=0.0).unwrapped
    env.reset(seed=0)
    for _ in range(40):
        observation, *_rest, info = env.step(np.array([0.4], np.float32))
    assert observation[0] % 0.5 == pytest.approx(0.0, abs=1e-5)
    assert observation[0] == pytest.approx(info["x2"], abs=0.26)
    assert observation[2] == pytest.approx(info["xr"] - info["read_x2"], abs=1e-4)


def test_preview_is_the_reference_to_come():
    env = gymnasium.make(NON_COLLOCATED, preview=(0.05, 0.2)).unwrapped
    first = env.reset(seed=0)[0]
    later = [env.step(np.zeros(1, np.float32))[0] for _ in range(40)]
    assert first[-2] == later[9][3]
    assert first[-1] == later[39][3]


def test_late_sensors_show_the_past():
    now, late = (gymnasium.make(IDS[2], sensor_delay=d) for d in (0.0, 0.02))
    a, b = [now.reset(seed=0)[0]], [late.reset(seed=0)[0]]
    for _ in range(60):
        a.append(now.step([0.4])[0])
        b.append(late.step([0.4])[0])
    assert np.array_equal(np.array(a)[:-4, :4], np.array(b)[4:, :4])
    assert np.array_equal(np.array(a)[:, 5], np.array(b)[:, 5])  # the reference is no sensor


def test_an_environment_is_the_drive_it_was_given_with_all_its_effects():
    effects = {
        "stribeck.cart_1.extra": 0.1, "presliding.cart_2.fd": 0.1, "hardening_spring.k3": 4e-5, "amplifier_lag.tau": 3e-3,
        "encoder_play.encoder_2.g": 0.2, "encoder_delay.encoder_1.tau": 2.5e-3, "friction_drift.cart_2.rate": 0.05,
        "input_offset.u0": 0.05, "extra_mode.mass_2": 4e-5, "spring_hysteresis.level": 0.05, "dead_zone.uz": 0.05,
        "base_recoil.compliance": 0.01,
    }  # fmt: skip
    env = gymnasium.make(
        NON_COLLOCATED, effects=effects, control_period=1e-3, physics_step=1e-3, duration=1.0
    ).unwrapped
    u = 2.0 * np.sin(2 * np.pi * 3 * np.arange(900) * 1e-3)
    run = env.drive.simulate(np.arange(901) * 1e-3, np.append(u, 0.0))
    env.reset(seed=0)
    for i, command in enumerate(u):
        info = env.step([command / env.task.voltage])[4]
        found = [info[f"read_{name}"] for name in ("x1", "x2", "v1", "v2")]
        assert np.allclose(found, [getattr(run, name)[i + 1] for name in ("x1", "x2", "v1", "v2")], atol=1e-5)


def test_a_delay_that_no_encoder_holds_is_refused():
    with pytest.raises(ValueError, match="encoder_delay.encoder_2.tau: at most"):
        gymnasium.make(
            NON_COLLOCATED, effects={"encoder_delay.encoder_2.tau": 0.03}, control_period=1e-4, physics_step=1e-4
        )


def test_effects_change_the_drive():
    slow = gymnasium.make(NON_COLLOCATED, effects={"input_delay.tau": 0.01})
    plain = gymnasium.make(NON_COLLOCATED)
    for env in (slow, plain):
        env.reset(seed=0)
    action = np.array([0.5], np.float32)
    assert slow.step(action)[4]["x1"] == 0.0
    assert plain.step(action)[4]["x1"] > 0.0


def test_randomised_drives_follow_the_identified_covariance():
    names, values = ("m1", "b1"), np.array([RIG["m1"], RIG["b1"]])
    matrix = np.diag((0.05 * values) ** 2)
    matrix[0, 1] = matrix[1, 0] = 0.8 * 0.05**2 * values.prod()
    drive = Drive(RIG, covariance=Covariance(names, matrix))
    env = gymnasium.make(NON_COLLOCATED, drive=drive, randomise="identified").unwrapped
    drawn = np.array([(env.reset(seed=s), [env.drive[n] for n in names])[1] for s in range(400)])
    assert np.allclose(drawn.mean(axis=0), values, rtol=0.01)
    assert np.corrcoef(drawn.T)[0, 1] == pytest.approx(0.8, abs=0.08)
    assert np.allclose(drawn.std(axis=0), 0.05 * values, rtol=0.15)


def test_p_control_through_the_environment_has_the_simulated_critical_gain():
    # 2.2 of the handout with control_period = 1 ms: bisect the gain at which x2 swings more than 25 mm
    drive = DEFAULT_DRIVE
    t = np.arange(12000) * 1e-3
    env = gymnasium.make(
        NON_COLLOCATED, drive=drive, control_period=1e-3, duration=12.0, travel_limit=1e5, stroke_limit=1e5,
        reference=point_to_point(t), preview=(),
    )  # fmt: skip

    def swing(gain):
        _o, info = env.reset(seed=0)
        x2 = []
        for _ in range(11999):
            _o, _r, _t, _c, info = env.step([gain * (info["xr"] - info["read_x2"]) / 8.0])
            x2.append(info["x2"])
        return np.ptp(x2[6000:])

    low, high = 0.15, 0.5
    while high > 1.004 * low:
        middle = np.sqrt(low * high)
        low, high = (low, middle) if swing(middle) > 25.0 else (middle, high)
    assert np.sqrt(low * high) == pytest.approx(critical_gain(drive, "x2"), rel=0.01)


def test_steps_need_a_reset_before_and_after():
    env = gymnasium.make(NON_COLLOCATED, duration=0.01).unwrapped
    with pytest.raises(ResetNeeded, match="before the first step"):
        env.step([0.0])
    env.reset(seed=0)
    assert [env.step([0.0])[3] for _ in range(2)] == [False, True]
    for e in (env, pickle.loads(pickle.dumps(env))):
        with pytest.raises(ResetNeeded, match="after the end of an episode"):
            e.step([0.0])
    env.reset()
    env.step([0.0])


def test_an_episode_starts_where_it_is_told():
    env = gymnasium.make(IDS[2]).unwrapped
    info = env.reset(seed=0, options={"x1": 10.0, "v2": 5.0})[1]
    assert [info[k] for k in ("x1", "v1", "x2", "v2", "read_v2")] == [10.0, 0.0, 0.0, 5.0, 5.0]
    assert info["read_x1"] == pytest.approx(10.0, abs=0.02)
    assert env.reset(options={"state": (1.0, 2.0, 3.0, 4.0)})[1]["v2"] == 4.0
    assert env.reset()[1]["x1"] == 0.0
    # without friction a spring stretched by δ pulls cart 2 with k·δ: after 1 ms it is at ½·(k·δ/m2)·t²
    free = {"d1": 0.0, "d2": 0.0, "b1": 0.0, "b2": 0.0, "C": 0.0}
    env = gymnasium.make(IDS[2], drive=DEFAULT_DRIVE.replace(free), control_period=1e-3)
    env.reset(seed=0, options={"x1": 10.0})
    pulled = 0.5 * DEFAULT_DRIVE["k"] * 10.0 / DEFAULT_DRIVE["m2"] * 1e-6
    assert env.step([0.0])[4]["x2"] == pytest.approx(pulled, rel=2e-3)


def test_the_time_limit_is_in_the_spec():
    env = gymnasium.make(NON_COLLOCATED, duration=10.0)
    assert env.spec.max_episode_steps == 2000
    assert isinstance(env, FlexDriveEnv)  # no wrapper cuts it
    assert gymnasium.make(env.spec).spec.max_episode_steps == 2000


def test_a_reference_with_keywords_may_be_one_text():
    named = gymnasium.make(NON_COLLOCATED, reference=("sine", {"amplitude": 10.0, "frequency": 0.5}))
    text = gymnasium.make(NON_COLLOCATED, reference="sine:amplitude=10:frequency=0.5")
    assert np.array_equal(named.unwrapped.task.references, text.unwrapped.task.references)


def test_unknown_render_mode_is_refused():
    with pytest.raises(ValueError, match="render_mode: must be None, human"):
        FlexDriveEnv(sensing="collocated", render_mode="video")


def test_rigid_drive_is_tracked_with_its_only_cart():
    env = gymnasium.make(IDS[0], drive=Drive({"m1": 1.1e-3, "b1": 0.0127, "d1": 0.5}))
    env.reset(seed=0)
    info = env.step(np.array([0.5], np.float32))[4]
    assert info["e"] == pytest.approx(info["xr"] - info["x1"])
    with pytest.raises(ValueError, match="needs two carts"):
        gymnasium.make(NON_COLLOCATED, drive=Drive({"m1": 1.1e-3, "b1": 0.0127}))


def test_p_control_in_ten_lines_tracks():
    env = gymnasium.make(NON_COLLOCATED)
    _o, info = env.reset(seed=0)
    controller, done, errors = PControl(0.1, "x2"), False, []
    while not done:
        u = controller.gain * (info["xr"] - info["read_x2"])
        _o, _r, terminated, truncated, info = env.step([u / env.unwrapped.task.voltage])
        errors.append(info["e"])
        done = terminated or truncated
    assert len(errors) == 800
    assert np.sqrt(np.mean(np.square(errors))) < 20.0


@pytest.mark.parametrize("mode", ["rgb_array", "ansi", "human"])
def test_rendering(mode, monkeypatch):
    pytest.importorskip("pygame", reason="needs the extra render")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    env = gymnasium.make(NON_COLLOCATED, render_mode=mode, duration=0.1)
    env.reset(seed=0)
    first = env.render()
    for _ in range(20):
        env.step(np.ones(1, np.float32))
    last = env.render()
    if mode == "rgb_array":
        assert first.shape == last.shape == (480, 960, 3)
        assert not np.array_equal(first, last)
    elif mode == "ansi":
        assert "[1]" in last
        assert first != last
    else:
        assert last is None
    env.close()


@each("name", IDS)
def test_gymnasiums_check_finds_nothing_in_rendering(name):
    pytest.importorskip("pygame", reason="needs the extra render")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gymnasium.make(name, render_mode="rgb_array").unwrapped)


@settings(max_examples=40, deadline=None)
@given(
    sensing=st.sampled_from(IDS),
    period=st.sampled_from([1e-3, 2e-3, 5e-3, 1e-2]),
    reference=st.sampled_from(["handout", "step", "square", "sine", "s_curve", "prbs", "random_moves"]),
    voltage=st.floats(0.5, 20.0),
    preview=st.lists(st.floats(0.0, 0.3), max_size=4),
    noise=st.floats(0.0, 1.0),
    normalise=st.booleans(),
    delay=st.sampled_from([0.0, 0.0007, 0.002]),
    seed=st.integers(0, 2**31),
)
def test_any_valid_arguments_make_an_environment_that_keeps_its_promises(
    sensing, period, reference, voltage, preview, noise, normalise, delay, seed
):
    env = gymnasium.make(
        sensing, control_period=period, reference=reference, voltage_limit=voltage, preview=preview, noise=noise,
        normalise=normalise, effects={"input_delay.tau": delay}, duration=0.1,
    )  # fmt: skip
    observation, info = env.reset(seed=seed)
    rng = np.random.default_rng(seed)
    for _ in range(round(0.1 / period)):
        assert env.observation_space.contains(observation)
        assert all(np.isfinite(v) for v in info.values())
        observation, reward, terminated, truncated, info = env.step(rng.uniform(-1, 1, 1).astype(np.float32))
        assert np.isfinite(reward)
        assert not (terminated and truncated)
        assert abs(info["u"]) <= voltage * (1 + 1e-6)
    assert truncated or terminated

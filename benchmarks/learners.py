"""PPO, SAC and TQC on the same task with the same wall-clock time on one core: error on references held out over time.

``python -m benchmarks learners [SECONDS]``. All see the same features and begin as the same P-control; each has the number of
drives that suits it. Needs sb3-contrib for TQC.
"""

import sys
import time

import torch
from stable_baselines3 import SAC
from stable_baselines3.common.callbacks import BaseCallback

from baselines.rl.evaluation import Evaluation
from baselines.rl.features import features
from baselines.rl.learner import HIDDEN, REWARD, FixedFeatures, begin_as_p_control, explore, learner, rate
from baselines.rl.training import Plan, starting_gain, task_arguments, training_drives
from baselines.rl.vec_env import FlexDriveVecEnv
from flexdrive_gym import DEFAULT_DRIVE

SECONDS, LOOKS = 240.0, 8
OFF_POLICY = {"drives": 64, "updates": 4, "batch": 512, "buffer": 400_000, "rate": 1e-3}


class _Clock(BaseCallback):
    """Ends a training after its time and evaluates it on the way; looking does not count."""

    def __init__(self, seconds: float, plan: Plan, *, on_policy: bool) -> None:
        super().__init__()
        self.seconds, self.on_policy = seconds, on_policy
        self.evaluate = Evaluation(DEFAULT_DRIVE, plan.history, **task_arguments(DEFAULT_DRIVE, plan.feedback))
        self.looked, self.began, self.found = 0.0, time.perf_counter(), []

    @property
    def share(self) -> float:
        return (time.perf_counter() - self.began - self.looked) / self.seconds

    def _on_rollout_start(self) -> None:
        share = self.share
        if share * LOOKS >= len(self.found):
            self.look()
        if self.on_policy:
            # the schedules of PPO run with the clock instead of the steps
            explore(self.model, share)
            self.model.lr_schedule = lambda _remaining: rate(1.0 - share)

    def look(self) -> None:
        begin = time.perf_counter()
        error = self.evaluate(lambda seen: self.model.predict(seen, deterministic=True)[0])
        self.looked += time.perf_counter() - begin
        self.found.append((self.share * self.seconds, self.model.num_timesteps, error))

    def _on_step(self) -> bool:
        return self.share < 1.0


def off_policy(kind: type[SAC], env: FlexDriveVecEnv, plan: Plan) -> SAC:
    """SAC or TQC with the features and the beginning that PPO has."""
    model = kind(
        "MlpPolicy", env, seed=plan.seed, device="cpu", learning_rate=OFF_POLICY["rate"], batch_size=OFF_POLICY["batch"],
        buffer_size=OFF_POLICY["buffer"], learning_starts=20_000, train_freq=1, gradient_steps=OFF_POLICY["updates"],
        gamma=0.99, ent_coef="auto_0.05",
        policy_kwargs={
            "net_arch": list(HIDDEN), "activation_fn": torch.nn.Tanh, "features_extractor_class": FixedFeatures,
            "features_extractor_kwargs": {"matrix": features(env.batch.task, plan.history)},
        },
    )  # fmt: skip
    actor = torch.nn.Sequential(*model.policy.actor.latent_pi, model.policy.actor.mu)
    begin_as_p_control(actor, starting_gain(DEFAULT_DRIVE), env.batch.task.voltage, plan.seed)
    return model


def main() -> None:
    seconds = float(sys.argv[2]) if len(sys.argv) > 2 else SECONDS
    torch.set_num_threads(1)
    kinds: dict[str, type[SAC] | None] = {"PPO": None, "SAC": SAC}
    try:
        from sb3_contrib import TQC
    except ImportError:
        print("TQC left out: pip install sb3-contrib")
    else:
        kinds["TQC"] = TQC
    print(f"rms e on references held out [mm] against seconds of wall clock, {seconds:g} s each, one core, seed 0")
    for name, kind in kinds.items():
        plan = Plan() if kind is None else Plan(envs=int(OFF_POLICY["drives"]))
        env = training_drives(DEFAULT_DRIVE, plan)
        if kind is None:
            model = learner(env, plan.history, seed=plan.seed, gain=starting_gain(DEFAULT_DRIVE))
        else:
            # rewards of the size of one suit a learner whose entropy is weighed against them
            env = _rewarded(plan)
            model = off_policy(kind, env, plan)
        clock = _Clock(seconds, plan, on_policy=kind is None)
        model.learn(2**40, callback=clock)
        clock.look()
        best = min(error for _s, _n, error in clock.found)
        print(f"{name}: best {best:.2f} mm; {model.num_timesteps / seconds / 1e3:.1f}k steps/s")
        print("   " + "  ".join(f"{s:.0f} s {error:.2f}" for s, _n, error in clock.found), flush=True)


def _rewarded(plan: Plan) -> FlexDriveVecEnv:
    from baselines.rl.curriculum import around, training_reference

    scaled = {name: 10.0 * weight for name, weight in REWARD.items()}
    return FlexDriveVecEnv(
        plan.envs, history=plan.history, normalise=False, reference=training_reference, reward=scaled,
        **around(DEFAULT_DRIVE), **task_arguments(DEFAULT_DRIVE, plan.feedback),
    )  # fmt: skip

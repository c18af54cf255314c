"""P-control from the second cart's encoder, in ten lines."""

import gymnasium

import flexdrive_gym  # registers the environments

env = gymnasium.make("FlexDrive-NonCollocated-v0", drive=flexdrive_gym.DEFAULT_DRIVE, control_period=1e-3)
observation, info = env.reset(seed=0)
done, squares = False, []
while not done:
    u = 0.1 * (info["xr"] - info["read_x2"])  # Kp = 0.1 V/mm
    observation, reward, terminated, truncated, info = env.step([u / env.unwrapped.task.voltage])
    done = terminated or truncated
    squares.append(info["e"] ** 2)
print(f"rms tracking error {(sum(squares) / len(squares)) ** 0.5:.2f} mm over {len(squares)} ms")

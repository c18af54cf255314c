"""Tries an installed flexdrive as its first user would: commands, Python, environments, an agent; without PyTorch.

Runs in whatever environment it is started with. ``--quick`` leaves out what compiles for long.
"""

import json
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

COMMAND = Path(sys.executable).with_name("flexdrive")


def flexdrive(*arguments: str) -> str:
    done = subprocess.run([COMMAND, *arguments], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f"flexdrive {' '.join(arguments)}: exit {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout


def commands() -> int:
    from baselines.lab.sample import FOLDER

    checked = json.loads(flexdrive("check", str(FOLDER), "--json"))
    assert checked["ready"], checked["advice"]
    flexdrive("identify", str(FOLDER), "-o", "drive.toml")
    gains = json.loads(flexdrive("stability", "drive.toml", "--draws", "0", "--json"))
    # friction holds gains that the linear loop does not
    assert 0.1 < gains["x2"]["critical_gain_linear"] < gains["x2"]["critical_gain_simulated"] < 0.3, gains
    flexdrive("validate", "drive.toml", str(FOLDER), "-o", "validation")
    return 4


def known_without_an_import() -> None:
    lines = (
        "import gymnasium, sys; gymnasium.spec('FlexDrive-NonCollocated-v0'); assert 'flexdrive_gym' not in sys.modules"
    )
    subprocess.run([sys.executable, "-W", "error", "-c", lines], check=True)


def environments() -> int:
    import gymnasium

    import flexdrive_gym
    from baselines.rl.agents import find_agent

    steps = 0
    for name in ("Collocated", "NonCollocated", "FullState"):
        env = gymnasium.make(f"FlexDrive-{name}-v0")
        env.reset(seed=0)
        for _ in range(100):
            assert env.step([0.1])[2] is False
            steps += 1
    find_agent("x2-0")
    assert flexdrive_gym.load_drive("drive.toml")["m1"] > 0.0
    return steps


def main() -> None:
    assert Path.cwd() not in [Path(p).resolve() for p in sys.path[1:]]
    version = flexdrive("--version").strip()
    assert "unknown" not in version, version
    assert "Usage" in flexdrive("--help")
    known_without_an_import()
    if "--quick" in sys.argv:
        print(version)
        return
    ran, steps = commands(), environments()
    without = "" if find_spec("torch") else " without torch"
    if without:
        refused = subprocess.run([COMMAND, "train", "-o", "agent"], capture_output=True, text=True, check=False)
        assert refused.returncode != 0, refused.stdout
        assert "flexdrive[rl]" in refused.stderr, refused.stderr
    print(f"{version}: {ran} commands and {steps} steps of 3 environments{without}")


if __name__ == "__main__":
    main()

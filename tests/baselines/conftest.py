"""A cluster on this machine, for what can be computed on one."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
# a busy machine takes a minute to import what a scheduler needs
PATIENCE_S = 300.0


@pytest.fixture
def cluster(tmp_path):
    """A Dask scheduler and two workers on the loopback interface; yields the address and the workers."""
    distributed = pytest.importorskip("distributed", reason="needs the extra dask")
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"}
    common = {"stderr": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "env": environment, "cwd": tmp_path}
    started = []

    def start(module, *arguments):
        command = [sys.executable, "-m", f"distributed.cli.{module}", *arguments, "--no-dashboard"]
        started.append(subprocess.Popen(command, **common))

    try:
        # the scheduler chooses its port, and writes where it is once it listens
        told = tmp_path / "scheduler.json"
        start("dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(told))
        address = _address(told)
        for _ in range(2):
            start("dask_worker", address, "--nthreads", "1", "--no-nanny", "--local-directory", str(tmp_path))
        with distributed.Client(address, timeout=PATIENCE_S, set_as_default=False) as client:
            client.wait_for_workers(2, timeout=PATIENCE_S)
        yield address, started[1:]
    finally:
        for process in started:
            process.kill()
            process.wait()


def _address(told):
    until = time.monotonic() + PATIENCE_S
    while time.monotonic() < until:
        try:
            return json.loads(told.read_text(encoding="utf-8"))["address"]
        except (OSError, ValueError):  # not written yet, or not to its end
            time.sleep(0.1)
    raise TimeoutError(f"the scheduler did not start within {PATIENCE_S:g} s")

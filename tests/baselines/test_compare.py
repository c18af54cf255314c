"""Comparisons are paired, repeatable, and the same wherever they are computed."""

import os
import signal
import socket
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binomtest

from baselines.compare import Entry, cases_of, compare, entries, headline, typical_effects
from baselines.report.compare_page import build_compare_page
from baselines.shares import share
from baselines.stability_limit import with_rig
from flexdrive_gym import Covariance, Drive
from flexdrive_gym.drive.effects import EFFECTS
from tests.drive.drives import RIG

ROOT = Path(__file__).parents[2]
SPREAD = np.diag([(0.05 * RIG[n]) ** 2 for n in ("m1", "m2", "k", "d1")])
DRIVE = Drive({**RIG, "saturation.limit": 8.0}, covariance=Covariance(("m1", "m2", "k", "d1"), SPREAD))


@dataclass
class BlackBox:
    """A black box, as a learnt policy is."""

    gain: float = 0.12

    def reset(self):
        pass

    def __call__(self, observation):
        return self.gain * (observation.xr - observation.x2)


def chosen():
    found, skipped = entries(DRIVE, ["p_x2", "lab4"])
    assert not skipped
    return found


def tables(comparison):
    return [r.measures for r in comparison.results]


def test_share_is_wilsons():
    for hits, n in ((0, 10), (7, 10), (500, 500), (13, 500)):
        ours = share([True] * hits + [False] * (n - hits))
        theirs = binomtest(hits, n).proportion_ci(method="wilson")
        assert (ours.low, ours.high) == pytest.approx((theirs.low, theirs.high), abs=1e-9)


def test_every_backend_finds_the_same():
    cases = cases_of(DRIVE, draws=60, effects=False, seed=1)
    reference = tables(compare(DRIVE, chosen(), cases=cases, empirical=False, backend="sequential"))
    for backend, jobs in (("threading", 2), ("loky", 2)):
        found = tables(compare(DRIVE, chosen(), cases=cases, empirical=False, backend=backend, jobs=jobs))
        assert all(np.array_equal(a, b) for a, b in zip(reference, found, strict=True))


def test_draws_are_the_seeds_and_the_same_for_all_controllers():
    a, b, c = (cases_of(DRIVE, draws=5, effects=False, seed=s) for s in (1, 1, 2))
    assert [x.drive.values for x in a] == [x.drive.values for x in b]
    assert a[1].drive["k"] != c[1].drive["k"]


def test_each_left_out_effect_is_a_case_and_what_the_drive_has_is_left():
    found = typical_effects(with_rig(DRIVE))
    names = {case.name.split(",")[0] for case in found}
    assert names <= {effect.id for effect in EFFECTS}
    assert "input_delay" in names
    assert not names & {"coulomb_friction", "viscous_friction", "spring", "saturation", "encoder_quantisation"}
    for case in found:
        assert dict(case.drive.values) != dict(with_rig(DRIVE).values)
        assert all(case.drive[n] == DRIVE[n] for n in RIG)


def test_a_black_box_is_measured_like_its_linear_twin(tmp_path):
    twins = [Entry("box", BlackBox(), "P-control nobody can look into", "x2"), *chosen()]
    cases = cases_of(DRIVE, draws=0, effects=False)
    found = compare(DRIVE, twins, cases=cases, duration=2.0, empirical=False, backend="sequential")
    box = found.results[0]
    assert box.margins is None
    assert box.draws is None
    assert box.nominal.rms == pytest.approx(found.results[1].nominal.rms, rel=0.2)
    assert headline(found)
    page = build_compare_page(found)
    assert "P-control nobody can look into" in page


def test_names_and_addresses_are_checked():
    entry = chosen()[0]
    with pytest.raises(ValueError, match="names must be unique"):
        compare(DRIVE, [entry, entry], cases=cases_of(DRIVE, draws=0, effects=False))
    with pytest.raises(ValueError, match=r"needs an address.*--scheduler"):
        compare(DRIVE, [entry], cases=cases_of(DRIVE, draws=0, effects=False), backend="dask")
    with pytest.raises(ValueError, match="backend: must be"):
        compare(DRIVE, [entry], cases=cases_of(DRIVE, draws=0, effects=False), backend="spark")


@pytest.fixture
def cluster(tmp_path):
    """A Dask scheduler and two workers on the loopback interface; yields the address and the workers."""
    pytest.importorskip("distributed", reason="needs the extra dask")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"}
    common = {"stderr": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "env": environment, "cwd": tmp_path}
    worker = ["-m", "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-nanny", "--no-dashboard",
              "--local-directory", str(tmp_path)]  # fmt: skip
    commands = [
        ["-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"],
        worker,
        worker,
    ]
    started = [subprocess.Popen([sys.executable, *command], **common) for command in commands]
    yield address, started[1:]
    for process in started:
        process.kill()
        process.wait()


@pytest.mark.slow
@pytest.mark.filterwarnings("default")  # the client warns of the worker that is lost on purpose
def test_a_lost_dask_worker_loses_nothing(cluster):
    address, workers = cluster
    cases = cases_of(DRIVE, draws=200, effects=False, seed=1)
    here = tables(compare(DRIVE, chosen(), cases=cases, empirical=False, backend="sequential"))

    def lose_one(done, _all):
        if done == 3:
            os.kill(workers[0].pid, signal.SIGKILL)

    there = compare(DRIVE, chosen(), cases=cases, empirical=False, backend="dask", scheduler=address, progress=lose_one)
    workers[0].wait(timeout=10)
    assert workers[1].poll() is None
    assert all(np.array_equal(a, b) for a, b in zip(here, tables(there), strict=True))

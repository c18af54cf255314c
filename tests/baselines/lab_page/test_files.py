"""What a visitor brings and what is computed of it."""

import asyncio
import gzip
from dataclasses import replace

import numpy as np
import pytest

from baselines.lab.sample import FOLDER
from baselines.lab_page.controller_files import read_controller
from baselines.lab_page.exercise import NOTHING, answer, choices, conceal, conduct
from baselines.lab_page.jobs import Job, JobError
from baselines.lab_page.overlay import overlay, signals
from baselines.lab_page.uploads import RefusedError, safe_path, take
from baselines.rl.agents import FOLDER as AGENTS
from flexdrive_gym import DEFAULT_DRIVE, Excitation, PControl
from flexdrive_gym.references import handout_trajectory
from identification import read_recordings, validate
from tests.each import each


async def pieces(data, size=65536):
    for i in range(0, len(data), size):
        yield data[i : i + size]


@each("name", ["../x.csv", "/etc/x.csv", "a/../../x.csv", "C:\\x.csv", "", "a\x00.csv", "..\\x.csv"])
def test_names_that_lead_elsewhere_are_refused(name):
    with pytest.raises(RefusedError):
        safe_path(name)


def test_only_recordings_are_taken():
    with pytest.raises(RefusedError, match="is no recording"):
        safe_path("run.py")
    assert safe_path("day/run.CSV.gz").as_posix() == "day/run.CSV.gz"


def test_large_files_and_bombs_are_refused_and_leave_nothing(tmp_path):
    with pytest.raises(RefusedError, match="larger than"):
        asyncio.run(take(tmp_path, "a.csv", pieces(b"1,2\n" * 1000), largest=1000))
    bomb = gzip.compress(b"0" * 5_000_000, 9)
    with pytest.raises(RefusedError, match="larger than"):
        asyncio.run(take(tmp_path, "a.csv.gz", pieces(bomb), most=1_000_000))
    assert not list(tmp_path.iterdir())
    assert asyncio.run(take(tmp_path, "b/a.csv", pieces(b"t,u\n"))).read_bytes() == b"t,u\n"


def test_a_controller_file_is_data(tmp_path):
    text = b'limit = 6.0\n[tf]\nnumerator = [0.05]\ndenominator = [1.0]\nreads = "x2"\n'
    own = read_controller("own.toml", text, DEFAULT_DRIVE)
    assert (own.order, own.limit) == (0, 6.0)
    agent = (AGENTS / "x2-0.npz").read_bytes()
    assert callable(read_controller("mine.npz", agent, DEFAULT_DRIVE))
    for name, content, words in (
        ("own.py", b"import os", "must be a .toml or .npz"),
        ("own.toml", b"x = 1", "own.toml: must have one table"),
        ("own.npz", b"PK no", "must be a policy file"),
        ("own.toml", b"#" * 1_000_001, "at most 1 MB"),
        ("own.toml", text.replace(b"limit = 6.0", b"sample_time = 0.0015"), "must be a whole number of the rig"),
    ):
        with pytest.raises(ValueError, match=words):
            read_controller(name, content, DEFAULT_DRIVE)


def test_a_command_that_fails_says_its_sentence(tmp_path):
    (tmp_path / "a.csv").write_text("nothing\n")
    with pytest.raises(JobError, match="flexdrive identify failed: (?s:.*)a.csv"):
        asyncio.run(Job().run(["identify", str(tmp_path), "-o", str(tmp_path / "d.toml")], lambda _: None))


def test_a_command_can_be_cancelled(tmp_path):
    async def story():
        job = Job()

        async def stop():
            while not job.running:  # noqa: ASYNC110  (nothing tells)
                await asyncio.sleep(0.01)
            job.cancel()

        with pytest.raises(JobError, match="Cancelled"):
            await asyncio.gather(job.run(["diagnose", str(FOLDER), "-o", str(tmp_path)], lambda _: None), stop())
        assert not job.running

    asyncio.run(story())


def test_a_computation_that_crashes_says_so_and_the_next_one_runs(tmp_path):
    async def story():
        job = Job()

        async def crash():
            while not job.running:  # noqa: ASYNC110  (nothing tells)
                await asyncio.sleep(0.01)
            job._process.kill()

        with pytest.raises(JobError, match="flexdrive diagnose failed: it ended with code -9 and said nothing"):
            await asyncio.gather(job.run(["diagnose", str(FOLDER), "-o", str(tmp_path)], lambda _: None), crash())
        assert not job.running

    asyncio.run(story())


def test_the_overlay_of_a_drives_own_run_differs_by_encoder_counts_alone():
    t = np.arange(4001) * 1e-3
    run = DEFAULT_DRIVE.simulate(t, np.where(np.mod(t, 2.0) < 1.0, 2.0, -2.0))
    chart, rms = overlay(DEFAULT_DRIVE, run, "v2", (1.0, 2.0))
    # the model has no counts: a difference of two that are rounded errs by a count over the root of six
    count = DEFAULT_DRIVE["encoder_quantisation.encoder_2.quantum"]
    assert rms == pytest.approx(count / 1e-3 / 6**0.5, rel=0.05)
    assert (chart.x.low, chart.x.high) == (1.0, 2.0)
    sine = read_recordings([FOLDER / "sine_2.5V_1.0Hz.csv.gz"])[0]
    assert signals(sine) == ["v1", "v2"]
    with pytest.raises(ValueError, match="x1 was not recorded"):
        overlay(DEFAULT_DRIVE, sine, "x1")


def test_an_exercise_from_beginning_to_end(tmp_path):
    exercise = conceal(seed=9)
    conduct(exercise, tmp_path, "square", 2.0, 0.5)
    conduct(exercise, tmp_path, "p_control", 0.05, 0.5)
    runs = read_recordings(tmp_path)
    assert [r.excitation.kind for r in runs] == ["square", "closed_loop"]
    effect = exercise.truth.effects[0]
    key = f"{effect.id}@{effect.where}"
    assert key in choices()
    assert answer(exercise, key).right
    assert not answer(exercise, NOTHING).right
    assert effect.where.replace("_", " ") in answer(exercise, NOTHING).sentence
    assert answer(conceal(seed=8), NOTHING).right
    with pytest.raises(ValueError, match="experiment: the amplitude"):
        conduct(exercise, tmp_path, "sine", 80.0, 1.0)


def test_a_recording_is_overlaid_with_what_validation_compares_it_with():
    t = np.arange(4001) * 1e-3
    rig = DEFAULT_DRIVE
    made = rig.simulate_closed_loop(t, handout_trajectory(t), PControl(0.1, "x2"), name="somebody's")
    # of a loop whose controller is unknown, whose encoders were not zeroed
    run = replace(made, x1=made.x1 + 40.0, x2=made.x2 + 40.0, v1=None, v2=None,
                  excitation=Excitation("closed_loop", 25.0, 0.5))  # fmt: skip
    drive = rig.replace(d1=1.3 * rig["d1"])
    chart, rms = overlay(drive, run, "x2")
    assert rms == pytest.approx({f.channel: f.rms for f in validate(drive, [run]).fits()}["x2"])
    assert "windows of" in chart.series[-1].name

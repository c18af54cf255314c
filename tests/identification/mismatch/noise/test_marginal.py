"""Output error beside what differs from run to run: friction of single runs explains nothing, and hides little."""

from dataclasses import replace

import numpy as np

from identification.mismatch.candidates.catalogue import catalogue
from identification.mismatch.fitting.fit import fit
from identification.mismatch.fitting.levels import Levels
from identification.mismatch.noise.estimate import first_noise
from identification.mismatch.noise.marginal import marginal
from identification.mismatch.noise.nuisance import directions
from identification.mismatch.selection.output_error import share_of_error
from identification.mismatch.selection.ranking import Scored
from identification.topology import TWO_CARTS
from tests.drive.drives import RIG
from tests.identification.mismatch.lab import bench_of, data_set

FRICTION = (1.12, 0.93, 1.04, 0.88, 1.08, 0.95)


def _restless(effect=None):
    """Runs of one rig whose dry friction differs from run to run."""
    runs = []
    for i, d in enumerate(FRICTION):
        rig = {**RIG, "d1": d * RIG["d1"], "d2": (2.0 - d) * RIG["d2"]}
        (run,) = data_set(effect, rig=rig, kinds=(("sine", 2.5, 1.0 + 0.3 * i),), first=i)
        runs.append(replace(run, name=f"run {i}"))
    return runs


def _metrics(bench, *residuals):
    """Return the output error of some models, and that beside run-to-run variability."""
    noise = first_noise(bench, RIG)
    return Levels.of(bench, *residuals), marginal(bench, noise, directions(bench, RIG), *residuals)


def test_friction_of_single_runs_makes_most_of_the_output_error_and_is_none_of_it():
    with bench_of(_restless()) as bench:
        e = bench.residual(RIG)
        _, beside = _metrics(bench, e)
        left = beside.left(e)
        assert np.sum(left**2) < 0.1 * np.sum(e**2)
        # of what is left every recording has its own level
        square = bench.sums(beside.white(e)[:, None] ** 2)[:, 0]
    assert square.max() < 5.0 * np.median(square)


def test_a_drive_that_lacks_something_stays_far_from_the_data():
    """What is the same in all runs is no friction of a run: an encoder that plays keeps its error."""
    with bench_of(data_set({"encoder_play.encoder_1.g": 1.0})) as bench:
        e = bench.residual(RIG)
        _, beside = _metrics(bench, e)
        assert np.sum(beside.left(e) ** 2) > 0.5 * np.sum(e**2)


def test_without_variability_it_is_the_output_error():
    with bench_of(data_set()[:2]) as bench:
        e = bench.residual(RIG)
        plain = marginal(bench, first_noise(bench, RIG), (), e)
        assert np.array_equal(plain.white(e), Levels.of(bench, e).white(e))


def test_a_small_effect_brings_left_out_runs_nearer_beside_their_friction():
    """A spring that hardens by 3e-5 V/mm³: by the output error alone it brings runs that are left out no nearer."""
    hardening = next(c for c in catalogue(TWO_CARTS) if c.name == ("hardening_spring", "spring"))
    with bench_of(_restless({"hardening_spring.k3": 3e-5})) as bench:
        names = ("m1", "m2", "b1", "b2", "d1", "d2", "k", *hardening.keys)
        fits = [fit(bench, m, {**RIG, **hardening.start}, names) for m in _metrics(bench, bench.residual(RIG))]
        alone, beside = (share_of_error(Scored(hardening, best, np.ones(6), 1), best) for best in fits)
    assert alone == 0.0
    assert beside > 0.05
    off = [abs(best.values["hardening_spring.k3"] - 3e-5) for best in fits]
    assert off[1] < off[0]

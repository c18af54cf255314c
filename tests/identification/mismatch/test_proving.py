"""What is found must be there: in every recording, and as the effect that it is called."""

from types import SimpleNamespace

import numpy as np
import pytest

from flexdrive_gym import Drive
from identification.mismatch.candidates import catalogue
from identification.mismatch.crew import Crew
from identification.mismatch.prove import own_friction
from identification.mismatch.proving import Proof, _left_out, _vanishes
from tests.drive.drives import RIG
from tests.identification.mismatch.lab import SHORT, short_day, workbench


@pytest.mark.parametrize(("interval", "vanishes"), [((0.013, 0.035), True), ((0.03, 0.2), False)])
def test_bristles_that_may_be_stiff_are_dry_friction(interval, vanishes):
    name = "presliding", "cart_2"
    values = {**RIG, "presliding.cart_2.fd": 0.02, "presliding.cart_2.xs": 0.05}
    candidate = next(c for c in catalogue() if c.name == name)
    step = SimpleNamespace(rival=SimpleNamespace(candidate=candidate))
    assert _vanishes(step, Drive(values, {"presliding.cart_2.xs": interval})) is vanishes


@pytest.mark.parametrize(
    ("share", "learnt", "kept", "ratio", "holds"),
    [
        (0.3, 0.3, 0.2, 0.9, True),
        # rough track hides what recordings kept away have among comparable residuals
        (0.05, 0.05, 0.03, 1.001, True),
        # the more the louder the day
        (0.137, 0.137, 0.096, 1.011, True),
        (0.137, 0.137, 0.01, 1.011, False),
        # but not what is small as well
        (0.015, 0.015, 0.03, 1.001, False),
        (0.015, 0.015, 0.03, 0.98, True),
        (0.015, 0.015, -0.1, 0.98, False),
        (0.05, 0.05, 0.001, 1.001, False),
        (0.05, 0.001, 0.03, 0.9, False),
    ],
)
def test_what_is_small_must_be_plain_in_recordings_kept_away(share, learnt, kept, ratio, holds):
    assert Proof(SimpleNamespace(), 8.0, 8.0, share, learnt, kept, ratio).holds is holds


def test_every_run_is_met_with_its_own_friction():
    rubbing = {"d2": 1.3 * RIG["d2"]}
    day = [*short_day(kinds=SHORT[1:2]), *short_day(rubbing, kinds=SHORT[1:2])]
    with Crew(2) as pool:
        bench = workbench(day, pool)
        bench.weigh(bench.residual(RIG))
        usual, other = own_friction(bench, RIG, 0.1)
    assert usual["d2"] == pytest.approx(RIG["d2"], rel=0.06)
    assert other["d2"] == pytest.approx(rubbing["d2"], rel=0.06)
    # nothing but friction is a run's own
    assert {k: v for k, v in other.items() if k[0] != "d"} == {k: v for k, v in RIG.items() if k[0] != "d"}


def test_the_spread_left_out_is_that_of_fits_without_each():
    rng = np.random.default_rng(3)
    runs, rows, n = 9, 40, 4
    J, e = rng.standard_normal((runs * rows, n)), rng.standard_normal(runs * rows)
    # every run is off by a number of its own
    e += np.repeat(rng.standard_normal(runs), rows) * J[:, 0]
    J[:rows, 3] *= 5.0
    z, *_ = np.linalg.lstsq(J, e, rcond=None)
    bench = SimpleNamespace(runs=range(runs), rows=SimpleNamespace(of=lambda r: slice(r * rows, (r + 1) * rows)))
    without = []
    for r in range(runs):
        others = np.ones(runs * rows, dtype=bool)
        others[bench.rows.of(r)] = False
        without.append(np.linalg.lstsq(J[others], e[others], rcond=None)[0] - z)
    jackknife = np.array(without).T @ np.array(without) * (runs - 1) / runs
    # at the fit, as a diagnosis has it
    assert _left_out(bench, J, e - J @ z) == pytest.approx(jackknife)

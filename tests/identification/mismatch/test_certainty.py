"""What is found must be there: in every recording, and as the effect that it is called."""

from types import SimpleNamespace

import numpy as np
import pytest

from flexdrive_gym import Covariance, Drive, Provenance
from identification.mismatch.candidates import catalogue
from identification.mismatch.certainty import between_runs, differs, foretold, is_there, students_t, uncertainty
from identification.mismatch.refit import Coordinates
from tests.drive.drives import RIG


@pytest.mark.parametrize(("interval", "vanishes"), [((0.013, 0.035), True), ((0.03, 0.2), False)])
def test_bristles_that_may_be_stiff_are_dry_friction(interval, vanishes):
    name = "presliding", "cart_2"
    values = {**RIG, "presliding.cart_2.fd": 0.02, "presliding.cart_2.xs": 0.05}
    candidate = next(c for c in catalogue() if c.name == name)
    assert is_there(candidate, Drive(values, {"presliding.cart_2.xs": interval})) is not vanishes


def test_the_spread_left_out_is_that_of_fits_without_each():
    rng = np.random.default_rng(3)
    runs, rows, n = 9, 40, 4
    J, e = rng.standard_normal((runs * rows, n)), rng.standard_normal(runs * rows)
    # every run is off by a number of its own
    e += np.repeat(rng.standard_normal(runs), rows) * J[:, 0]
    J[:rows, 3] *= 5.0
    z, *_ = np.linalg.lstsq(J, e, rcond=None)
    bench = SimpleNamespace(runs=range(runs), rows=SimpleNamespace(of=lambda r: slice(r * rows, (r + 1) * rows)))
    without, errors = [], []
    for r in range(runs):
        others = np.ones(runs * rows, dtype=bool)
        others[bench.rows.of(r)] = False
        without.append(np.linalg.lstsq(J[others], e[others], rcond=None)[0] - z)
        errors.append(np.sum((e - J @ (z + without[-1]))[~others] ** 2))
    jackknife = np.array(without).T @ np.array(without) * (runs - 1) / runs
    # at the fit, as a diagnosis has it
    assert between_runs(bench, J, e - J @ z, left_out=True) == pytest.approx(jackknife)
    assert foretold(bench, J, e - J @ z) == pytest.approx(errors)


def test_what_one_recording_alone_shows_is_not_steady():
    assert students_t(np.array([1.0, 1.2, 0.9, 1.1])) > 10.0
    assert students_t(np.array([4.0, 0.0, 0.1, -0.1])) < 1.1
    assert students_t(np.ones(1)) == 0.0


def test_a_size_that_is_certain_elsewhere_is_not_asked_for_again_but_its_shape_is():
    values = {**RIG, "presliding.cart_2.fd": 0.02, "presliding.cart_2.xs": 0.05}
    candidate = next(c for c in catalogue() if c.name == ("presliding", "cart_2"))
    names = ("presliding.cart_2.fd", "presliding.cart_2.xs")
    spread = Covariance(names, np.diag([0.02**2, 0.001**2]))
    whence = Provenance("values", tuple("abcdefghi"))
    for interval, is_it in (((0.03, 0.2), True), ((0.013, 0.035), False)):
        drive = Drive(values, {"presliding.cart_2.xs": interval}, spread, whence)
        assert not differs(candidate, drive)
        assert not is_there(candidate, drive)
        assert is_there(candidate, drive, certain=True) is is_it


def test_a_limit_at_infinity_has_no_spread():
    values = {**RIG, "saturation.limit": float("inf")}
    intervals, found = uncertainty(Coordinates(["m1", "saturation.limit"], values), values, 0.01 * np.eye(2), 8)
    assert intervals["saturation.limit"] == (float("inf"), float("inf"))
    assert np.array_equal(found.matrix != 0.0, [[True, False], [False, False]])

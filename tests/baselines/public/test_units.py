"""Another rig's units keep the equations' form."""

import pytest

from baselines.public import Units

UNITS = Units(output="V", length=100.0, time=3.0, voltage=20.0)


@pytest.mark.parametrize(
    ("unit", "one", "name"),
    [
        ("V", 20.0, "V"),
        ("V/mm", 20.0 / 100.0, "V/V"),
        ("V/mm³", 20.0 / 100.0**3, "V/V³"),
        ("V s²/mm", 20.0 * 9.0 / 100.0, "V s²/V"),
        ("mm/s", 100.0 / 3.0, "V/s"),
        ("Hz", 1.0 / 3.0, "Hz"),
        ("1", 1.0, "1"),
    ],
)
def test_one_of_the_rigs_unit(unit, one, name):
    assert UNITS.of_rig(one, unit) == (pytest.approx(1.0), name)


def test_the_frequency_of_an_oscillator_does_not_depend_on_units():
    k, m = UNITS.of_rig(0.2, "V/mm")[0], UNITS.of_rig(1e-5, "V s²/mm")[0]
    assert (k / m) ** 0.5 == pytest.approx((0.2 / 1e-5) ** 0.5 * 3.0)

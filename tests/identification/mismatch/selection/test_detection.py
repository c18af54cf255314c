"""Below which size recordings do not show an effect."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.special import i0e

from identification.mismatch.candidates.catalogue import Candidate
from identification.mismatch.candidates.phases import Phase
from identification.mismatch.selection.detection import amplitude, detection_limits
from identification.mismatch.selection.linear import Entry
from identification.mismatch.selection.null import Null
from identification.mismatch.settings import Settings

LEVEL = 0.01
UNITS = 5


def _linear(white, entries):
    """Sensitivities of as many rows in each unit, the first of which is the base model's."""
    rows = [slice(u * len(white) // UNITS, (u + 1) * len(white) // UNITS) for u in range(UNITS)]
    products = np.array([white[r].T @ white[r] for r in rows])
    bench = SimpleNamespace(settings=Settings(), rows=rows, units=np.arange(UNITS))
    return SimpleNamespace(base=range(1), products=products, white=white, entries=entries, bench=bench)


@pytest.fixture
def null():
    names = [("quadratic_drag", "cart_1"), ("tilt", "guide"), ("saturation", "actuator"), ("cogging", "drivetrain")]
    return Null.of({n: np.random.default_rng(i).exponential(1.0, 480) for i, n in enumerate(names)})


def test_a_limit_is_the_size_whose_expected_gain_is_significant(null):
    """Half of its square times the information beside the base model, without the experiment that tells most."""
    rng = np.random.default_rng(0)
    base, own = rng.normal(size=(2, 1000))
    own[:200] *= 3.0
    drag = Candidate("quadratic_drag", "cart_1", (("quadratic_drag.cart_1.c", 1e-5),))
    scale = 1e7
    (limit,) = detection_limits(_linear(np.column_stack([base, scale * own]), [Entry(drag, (1,))]), null, LEVEL)
    rest = own - base * (base @ own) / (base @ base)
    gain = 0.5 * (limit.value * scale) ** 2 * float(rest[200:] @ rest[200:])
    assert gain == pytest.approx(null.needed(drag.name, LEVEL), rel=0.01)
    assert (limit.parameter, limit.unit, limit.shape) == ("c", "V s²/mm²", {})


def test_what_a_base_parameter_does_as_well_is_never_seen(null):
    base = np.random.default_rng(1).normal(size=1000)
    tilt = Candidate("tilt", "guide", (("tilt.F", 0.05),))
    (limit,) = detection_limits(_linear(np.column_stack([base, 2.0 * base]), [Entry(tilt, (1,))]), null, LEVEL)
    assert limit.value == np.inf


def test_limits_of_what_acts_in_no_proportion_are_not_told(null):
    limit = Candidate("saturation", "actuator", (("saturation.limit", 2.0),))
    assert not detection_limits(_linear(np.ones((100, 2)), [Entry(limit, (1,))]), null, LEVEL)


def test_the_easiest_form_is_told(null):
    white = np.random.default_rng(2).normal(size=(1000, 7))
    white[:, 3:5] *= 2.0
    entries = [Entry(Phase("cogging", "drivetrain", p), (1 + 2 * i, 2 + 2 * i)) for i, p in enumerate((5.0, 7.0, 9.0))]
    (limit,) = detection_limits(_linear(white, entries), null, LEVEL)
    assert limit.shape == {"P": (7.0, "mm")}
    assert limit.unit == "V"


def test_an_amplitude_with_a_phase_in_every_recording_gains_less_than_one_with_a_known_phase():
    information = np.full(8, 50.0)
    size = amplitude(information, np.arange(8), 10.0)
    x = size**2 * information[1:]
    assert float(np.sum(np.log(i0e(x)) + 0.5 * x)) == pytest.approx(10.0)
    assert size > np.sqrt(2.0 * 10.0 / information[1:].sum())
    assert amplitude(np.zeros(8), np.arange(8), 10.0) == np.inf

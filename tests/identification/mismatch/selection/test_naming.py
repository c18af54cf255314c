"""Which of the candidates that gain more than chance gets a name."""

from types import SimpleNamespace

import numpy as np
import pytest

from identification.mismatch.candidates.catalogue import Candidate
from identification.mismatch.candidates.phases import Phase
from identification.mismatch.selection import naming
from identification.mismatch.selection.naming import Naming
from identification.mismatch.selection.ranking import Scored
from identification.mismatch.settings import Settings

LEVEL = 0.01


@pytest.mark.parametrize(
    ("gained", "share", "beyond", "named"),
    [
        (1000.0, 0.02, False, True),
        (3000.0, 0.02, False, False),
        (3000.0, 0.02, True, True),
        (3000.0, 0.002, True, False),
        (3000.0, 0.3, False, True),
    ],
)
def test_what_a_law_that_is_inexact_leaves_is_no_other_effect(gained, share, beyond, named):
    """A gain goes with the square of a force: seven per cent of the force that is named have half a per cent of its gain.

    What brings the simulation near is another effect all the same, and so is what takes as much off it beside the earlier name:
    an encoder that plays gains by milliseconds what a brake never can.
    """
    offset = Scored(Candidate("input_offset", "actuator", (("u0", 1.0),)), None, np.full(12, 1.0), 1, 0.004)
    asked = SimpleNamespace(bench=SimpleNamespace(settings=Settings()), significant=lambda *_: [offset])
    asked.share, asked.beyond = lambda *_: share, lambda *_: beyond
    asked.share_of_first = asked.share
    step = SimpleNamespace(scored=[offset], best=offset, null=None, base=None)
    assert offset.total == pytest.approx(11.0)
    assert (Naming.name(asked, step, None, gained) is offset) == named


@pytest.mark.parametrize(("share", "beyond"), [(0.03, False), (0.05, True)])
def test_what_a_name_takes_off_is_held_against_what_the_names_before_it_took_off(monkeypatch, share, beyond):
    """Of a squared output error of 1,000 names took 900 off: half a per cent of that is 4.5, a share of 0.045 of what is left."""
    cost = {"before": 1000.0, "with them": 100.0}
    monkeypatch.setattr(naming.Levels, "of", lambda *_: None)
    monkeypatch.setattr(
        naming, "held_first", lambda _bench, _levels, values, _names: SimpleNamespace(cost=cost[values])
    )
    before, base = (SimpleNamespace(values=v, names=(), residual=None) for v in cost)
    asked = Naming(SimpleNamespace(settings=Settings()), LEVEL)
    assert asked.beyond(SimpleNamespace(fit=base), share, base, before) == beyond


def test_the_first_name_is_asked_beside_the_friction_of_runs_and_a_ripple_is_not(monkeypatch):
    """A ripple with a phase of its own in every run is run-to-run variability: beside that nothing is left of it."""
    monkeypatch.setattr(naming, "marginal", lambda *_: "beside friction of runs")
    monkeypatch.setattr(naming.Levels, "of", lambda *_: "plain")
    monkeypatch.setattr(naming, "restarts", lambda *_: [])
    monkeypatch.setattr(
        naming, "held_first", lambda _b, metric, _v, names: SimpleNamespace(cost=len(names), metric=metric)
    )
    monkeypatch.setattr(naming, "share_of_error", lambda _s, best: best.metric)
    asked = Naming(SimpleNamespace(settings=Settings(), pool=SimpleNamespace(map=map)), LEVEL)
    drive = SimpleNamespace(values={}, names=(), residual=None)
    step = SimpleNamespace(base=drive, noise=None, variability=())
    offset = SimpleNamespace(fit=drive, candidate=Candidate("input_offset", "actuator", (("u0", 1.0),)))
    ripple = SimpleNamespace(fit=None, candidate=Phase("cogging", "drivetrain", 20.0))
    assert asked.share_of_first(offset, step, drive) == "beside friction of runs"
    assert asked.share(offset, drive) == asked.share_of_first(ripple, step, drive) == "plain"

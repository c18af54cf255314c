"""What is said of an effect without a name."""

from types import SimpleNamespace

import numpy as np

from identification.mismatch.answer.unnamed import unnamed
from identification.mismatch.candidates.catalogue import Candidate
from identification.mismatch.selection.ranking import Scored
from identification.mismatch.selection.selector import Selection


def test_what_has_another_size_in_every_experiment_is_told_by_what_it_is_like():
    like, next_ = (
        Scored(Candidate(id_, "guide", ((key, 1.0),)), None, np.full(4, gain), 1, 0.002)
        for id_, key, gain in (("ground_spring", "ground_spring.kg", 20.0), ("tilt", "tilt.F", 5.0))
    )
    base = SimpleNamespace(normal=SimpleNamespace(square=np.full(4, 50.0)))
    step = SimpleNamespace(base=base, best=like, scored=[like, next_], accepted=True)
    last = SimpleNamespace(accepted=False, best=next_)
    selection = Selection((step, last), base, base, (), (), 0.01, ((like, step),))
    said = unnamed(None, selection, named=False)
    assert said.where == "guide"
    assert said.acts_on == "like ground spring, but with a size that differs between experiments"
    assert [named.id for named, _ in said.nearest] == ["ground_spring", "tilt"]
    # another effect that has a name does not make it known
    assert unnamed(None, selection, named=True) == said

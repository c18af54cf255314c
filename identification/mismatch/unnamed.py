"""What has no name: a shape, something that only resembles a name, a rhythm, or merely more error than a restless rig has."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from flexdrive_gym.units import LAB, Units
from identification.mismatch.comes_again import KeptAway
from identification.mismatch.excess import excess
from identification.mismatch.lines import strongest_line
from identification.mismatch.proof import FORETOLD, Proof
from identification.mismatch.rounds import LEVEL, Stage
from identification.mismatch.search import Search, Step, Unlike
from identification.mismatch.shapes import ALONG_TRACK, AXES, FRICTION, WORTH, Shape, likeness
from identification.mismatch.verdict import Curve, Unnamed, phrase
from identification.mismatch.workbench import Workbench

# a free shape must explain this much more than all names together to be called unnamed in their place
_SHAPE_LEAD = 1.6
# a smaller shape counts if it predicts this share of the error, and recordings kept away show it as no chance does that was
# drawn: it is the best of some
_SMALL, _SELDOM_SHAPED = 0.005, 0.005
# a line in the spectrum must explain this share of the error
_LINE_SHARE = 0.05
# names of forces that stand on the track, and the carts on which they act
_STANDS = {"cogging": ("cart_1",), "ground_spring": ("cart_1", "cart_2")}


def left_unnamed(found: Search) -> tuple[tuple[Shape, Stage] | None, tuple[Step, ...]]:
    """Return the free shape that no name fits with its round, if there is one, and the names that it overrules.

    A shape that goes far beyond everything that was named together, before the names or beside them, says that they were only the
    nearest ones. One that is left beside names counts by its share of all that was to be explained: what a name's own law
    lacks is no other physics. But a force along the track that is left beside the name of such a force on the same cart says
    that this name was a piece of it.
    """
    left, overruled = _left_beside(found, found.steps)
    others = tuple(s for s in found.steps if s not in overruled)
    if left is not None and overruled and others:
        # what had been found beside a name that goes is held against the shape by itself
        _, more = _left_beside(found, others)
        overruled = (*overruled, *more)
    return left, overruled


def _left_beside(found: Search, steps: Sequence[Step]) -> tuple[tuple[Shape, Stage] | None, tuple[Step, ...]]:
    named = 1.0 - float(np.prod([1.0 - s.rival.gain for s in steps]))
    most = _SHAPE_LEAD * named
    rounds = [(found.last, found.last_shapes, WORTH, 1.0 - named)]
    if steps:
        rounds.insert(0, (found.stages[0], found.first_shapes, max(WORTH, most), 1.0))
    for stage, shapes, least, left in rounds:
        for shape in shapes:
            share = shape.predicted * left
            if share >= least and shape.probability <= LEVEL:
                alike = [s for s in steps if _along_the_same(s, shape)]
                return (shape, stage), tuple(steps if share >= most else alike)
    return None, ()


def _along_the_same(step: Step, shape: Shape) -> bool:
    """Whether a name is a force along the track on the cart of a shape that is one, too."""
    id_, _ = step.rival.name
    return shape.variable == ALONG_TRACK and shape.where in _STANDS.get(id_, ())


def describe(
    bench: Workbench,
    found: Search,
    left: tuple[Shape, Stage] | None,
    commands: Sequence[float],
    refused: Sequence[Proof] = (),
    kept_away: KeptAway | None = None,
    units: Units = LAB,
) -> Unnamed | None:
    """Return what no name explains: a name that recordings disagree about, a shape, a rhythm, more than restlessness.

    Parameters
    ----------
    left
        The shape that no name fits, of :func:`left_unnamed`.
    commands
        Frequency of every recording's command [Hz]; 0 where it does not repeat.
    refused
        Names that did not stand, if none does.
    kept_away
        Recordings for what no name explains; none if a name stands.
    units
        The rig's, for the sentence.
    """
    most = max(found.unlike, key=lambda u: u.share, default=None)
    if most is not None and most.share >= WORTH and (left is None or most.share > left[0].predicted):
        return _resembling(most)
    if left is not None:
        return _drawn(bench, *left, units)
    return (
        _rhythm(bench, found, commands, units)
        or nearly_named(refused)
        or _shown_again(bench, found, kept_away, units)
        or _restless(bench, found)
    )


def _shown_again(bench: Workbench, found: Search, kept_away: KeptAway | None, units: Units) -> Unnamed | None:
    """Return a free shape that is too small to be reported by itself, if recordings kept away show it, too."""
    stage = found.stages[0]
    small = [s for s in found.first_shapes if s.probability <= LEVEL and s.variable != ALONG_TRACK]
    best = max(small, key=lambda s: s.predicted, default=None)
    if best is None or best.predicted < _SMALL or kept_away is None:
        return None
    model = stage.before
    again = kept_away.shape_comes_again(model.values, best, model.names)["comparable"]
    if again.probability > _SELDOM_SHAPED or not again.as_large:
        return None
    shape = _drawn(bench, best, stage, units)
    too = f"; it is small, but recordings kept away show it, too (p = {again.probability:.2g})"
    return replace(shape, acts_on=shape.acts_on + too)


def _drawn(bench: Workbench, shape: Shape, stage: Stage, units: Units) -> Unnamed:
    nearest = likeness(bench, shape, stage.screened)
    one, force = units.one(AXES[shape.variable.removeprefix(FRICTION)]), units.one("V")
    curve = Curve(shape.variable, shape.knots / one, shape.force / force, shape.band / force, units)
    return Unnamed(shape.where, shape.predicted, shape.sentence(units), tuple(nearest[:3]), curve)


def _resembling(found: Unlike) -> Unnamed:
    """Return what resembles an effect, but needs another size of it in every recording."""
    id_, where = found.step.rival.name
    acts = (
        f"what {phrase(id_)} at {where.replace('_', ' ')} would do, but with a size that differs from recording to recording"
        f" (p = {found.disagreement.probability:.2g})"
    )
    return Unnamed(found.disagreement.where, found.share, acts, ((id_, found.likeness),))


def nearly_named(proofs: Sequence[Proof]) -> Unnamed | None:
    """Return what all recordings show where they are compared, but what its name does not describe well enough to be proven."""
    there = [p for p in proofs if p.foretold]
    if not there:
        return None
    best = max(there, key=lambda p: p.learnt)
    id_, where = best.step.rival.name
    resembles = f"what {phrase(id_)} at {where.replace('_', ' ')} would do: "
    if best.steady > FORETOLD:
        acts = resembles + (
            f"recordings foretell it of one another (t = {best.steady:.2g}), "
            "but it does not lower the plain error of those kept away"
        )
    else:
        sizes = " and ".join(f"{seen.size:.2g}" for seen in best.again.values())
        acts = resembles + (
            f"recordings kept away show it (p = {best.again[best.step.view].probability:.2g}), "
            f"but {sizes} times as large, by the ways of comparing them"
        )
    # of what it explains where it was learnt, recordings kept away confirm this part
    alike = float(np.sqrt(np.clip(best.kept / best.learnt, 0.0, 1.0)))
    return Unnamed(where, best.learnt, acts, ((id_, alike),))


def _rhythm(bench: Workbench, found: Search, commands: Sequence[float], units: Units) -> Unnamed | None:
    """Return a disturbance with a rhythm of its own, which no property of the drive can make."""
    values = found.model.values
    line = strongest_line(bench, bench.residual(values), commands, values)
    if line is None or line.share < _LINE_SHARE:
        return None
    acts = f"{units.text(line.frequency, 'Hz', 3)} whatever the command: a disturbance from outside"
    return Unnamed(line.where, line.share, acts, ())


def _restless(bench: Workbench, found: Search) -> Unnamed | None:
    """Return that there is more error than a rig's own restlessness makes, whatever it follows.

    What surrounds the two rigs that this was learnt from says nothing on a rig of which there is one recording.
    """
    if bench.parts:
        return None
    beyond = excess(bench, found.last.null, found.last.before)
    if beyond.probability > LEVEL:
        return None
    most = " and ".join(f"{bench.runs[r].name} ({share:.0%})" for r, share in beyond.runs)
    acts = (
        f"no single signal (v1, v2, δ, u, x1, x2 or time); it exceeds what differs between runs of such a rig "
        f"(p = {beyond.probability:.2g}) and is largest in {most}"
    )
    return Unnamed(beyond.where, beyond.share, acts, ())

"""One door to both methods: the handout's readings and maximum likelihood."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from flexdrive_gym import Drive, Recording
from flexdrive_gym.drive.parameters import parameter
from identification.likelihood import MaximumLikelihood, identify_by_likelihood
from identification.quantities import HANDOUT_RATIOS, Quantity
from identification.recordings import Rig
from identification.recordings.given import Source, given
from identification.selection import select
from identification.step_response import HandoutResult, identify_by_handout

METHODS = ("handout", "ml")
Method = Literal["handout", "ml"]
# of a limit, by which a command may exceed it: converters round
_EXCEEDED = 1e-3


@dataclass(frozen=True, eq=False)
class Identification:
    """An identified drive and how it was found.

    Attributes
    ----------
    drive
        Ready for simulation, environment and controllers; carries the rig's encoder counts and command limit.
    quantities
        The handout's quantities of 3.5.
    method
        ``handout`` or ``ml``.
    result
        The method's own result with all its readings.
    """

    drive: Drive
    quantities: Mapping[str, Quantity]
    method: Method
    result: HandoutResult | MaximumLikelihood

    @property
    def effects(self) -> dict[str, Quantity]:
        """Fitted parameters of the effects that the rig description knows."""
        names = () if self.drive.covariance is None else self.drive.covariance.names
        return {
            n: Quantity(self.drive[n], parameter(n).unit, "maximum likelihood", ci95=self.drive.intervals.get(n))
            for n in names
            if "." in n
        }

    def __str__(self) -> str:
        return str(self.result)


def rig_parameters(recordings: Sequence[Recording]) -> dict[str, float]:
    """Return what recordings tell of sensors and amplifier: encoder counts, velocity filter, command limit."""
    found: dict[str, float] = {}
    for i in (0, 1):
        quanta = [r.quantum[i] for r in recordings if r.quantum[i] > 0.0]
        if quanta:
            found[f"encoder_quantisation.encoder_{i + 1}.quantum"] = min(quanta)
        cutoffs = [r.velocity_cutoff for r in recordings if r.velocity_cutoff]
        if cutoffs:
            found[f"velocity_processing.encoder_{i + 1}.cutoff"] = min(cutoffs)
    limits = [r.excitation.limit for r in recordings if r.excitation.limit is not None]
    # a controller that rests at its largest command looks limited; an amplifier's limit is exceeded by no run
    if limits and max(limits) > (1.0 - _EXCEEDED) * max(float(np.max(np.abs(r.u))) for r in recordings):
        found["saturation.limit"] = max(limits)
    return found


def identify(
    recordings: Source,
    method: Method = "ml",
    *,
    ties: Mapping[str, float] | None = None,
    p: float | None = None,
    damping: bool = False,
    threads: int | None = None,
    rig: Rig | str | Path | None = None,
) -> Identification:
    """Identify a drive.

    Parameters
    ----------
    recordings
        Folder, files, or recordings already read.
    method
        ``handout`` reads the quantities off the step responses (3.2); ``ml`` fits all open-loop recordings jointly.
    ties
        Ratios held at a value: ``alpha`` = m2/m1, ``beta`` = b2/b1, ``gamma`` = d2/d1. The handout method ties all
        three (0.54, 0.1, 0.1 unless given); maximum likelihood none unless given.
    p
        Handout method only: use this real pole [1/s] instead of the one read (3.3's slight adjustment).
    damping
        Maximum likelihood only: fit the spring's damping C too.
    threads
        Maximum likelihood only: number of threads; the answer does not depend on it.
    rig
        Rig description, or its file, to read recordings with; those already read bring theirs.

    Raises
    ------
    ValueError
        For an unknown method, an argument the method has no use for, or recordings it cannot use.
    """
    if method not in METHODS:
        raise ValueError(f"method: must be {' or '.join(METHODS)}; got {method!r}.")
    selection = select(given(recordings, rig))
    runs = selection.require()
    told = rig_parameters(runs)
    if method == "handout":
        if damping:
            raise ValueError("damping: the handout assumes C = 0; got damping=True. Use method='ml'.")
        handout = identify_by_handout(runs, **{**HANDOUT_RATIOS, **(ties or {})}, p=p)
        handout = replace(handout, notes=(*selection.notes, *handout.notes))
        drive = handout.drive()
        return Identification(drive.replace(told, intervals=drive.intervals), handout.quantities, method, handout)
    if p is not None:
        raise ValueError(f"p: only the handout method reads p off and can be told another; got {p:g}.")
    likely = identify_by_likelihood(runs, ties=ties, damping=damping, threads=threads)
    likely = replace(likely, notes=(*selection.notes, *likely.notes))
    if likely.drive.carts == 1:
        told = {name: value for name, value in told.items() if "encoder_2" not in name}
    drive = likely.drive.replace(told, intervals=likely.drive.intervals, covariance=likely.drive.covariance)
    return Identification(drive, likely.quantities, method, likely)

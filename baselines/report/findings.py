"""Everything a report shows, computed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

from baselines.lab.lab_scale import on_lab_scale
from baselines.loop_analysis.stability_limit import ObservedLimit, StabilityLimit, observed_limit, stability_limit
from flexdrive_gym import Drive, Recording
from identification import Identification, Validation, identify, validate
from identification.frequency_response import FrequencyTable, measure_frequency_response
from identification.likelihood import MaximumLikelihood, identify_by_likelihood
from identification.quantities import HANDOUT_RATIOS
from identification.selection import select

STEPS = 8
Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Findings:
    """Everything a report shows.

    Attributes
    ----------
    recordings
        As read, with faults.
    handout
        Result of 3.2, or the sentence that says why there is none.
    likely, tied
        Maximum likelihood fits with free ratios and with the handout's.
    validation, handout_validation
        Of ``likely``'s drive, and of the handout's where there is one, on every recording.
    table
        Measured frequency response, or ``None`` without sines.
    task
        The identified drive on the scale of the laboratory's tasks, :func:`~baselines.lab.lab_scale.on_lab_scale`.
    limits
        Stability limits of it per feedback.
    observed
        What the recorded P-control runs, on that scale, say of the limit.
    """

    recordings: tuple[Recording, ...]
    handout: Identification | str
    likely: Identification
    tied: MaximumLikelihood | None
    validation: Validation
    handout_validation: Validation | None
    table: FrequencyTable | None
    task: Drive
    limits: dict[str, StabilityLimit]
    observed: ObservedLimit

    @property
    def task_runs(self) -> tuple[Recording, ...]:
        """The recordings on the scale of the laboratory's tasks."""
        return tuple(r.rescaled(self.task.units) for r in self.recordings)

    @property
    def fit(self) -> MaximumLikelihood:
        """The maximum likelihood result."""
        assert isinstance(self.likely.result, MaximumLikelihood)
        return self.likely.result


def find(recordings: Sequence[Recording], progress: Progress = lambda _: None) -> Findings:
    """Compute everything a report shows.

    Parameters
    ----------
    recordings
        A data set.
    progress
        Told the name of every step before it begins; there are :data:`STEPS`.
    """
    progress("handout 3.2")
    try:
        handout: Identification | str = identify(recordings, "handout")
    except ValueError as error:
        handout = str(error)
    progress("maximum likelihood")
    likely = identify(recordings)
    progress("handout's ratios held")
    two = likely.drive.carts == 2
    tied = identify_by_likelihood(select(recordings).require(), ties=HANDOUT_RATIOS) if two else None
    progress("validation")
    validation = validate(likely.drive, recordings)
    by_handout = None if isinstance(handout, str) else validate(handout.drive, recordings)
    progress("frequency response")
    sines = [r for r in recordings if r.excitation.kind == "sine"]
    table = measure_frequency_response(sines) if sines else None
    progress("stability limit")
    feedbacks: tuple[Literal["x1", "x2"], ...] = ("x1", "x2") if two else ("x1",)
    task = on_lab_scale(likely.drive)
    limits: dict[str, StabilityLimit] = {f: stability_limit(task, f) for f in feedbacks}
    observed = observed_limit([r.rescaled(task.units) for r in recordings])
    return Findings(tuple(recordings), handout, likely, tied, validation, by_handout, table, task, limits, observed)

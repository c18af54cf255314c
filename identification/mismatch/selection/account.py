"""What a model leaves of recordings, told apart: noise, and everything that could be named."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from flexdrive_gym.recording import FloatArray
from identification.mismatch.candidates.catalogue import Candidate
from identification.mismatch.candidates.free import shapes
from identification.mismatch.fitting.bench import Bench
from identification.mismatch.fitting.fit import Fit
from identification.mismatch.noise.breakaway import with_secants
from identification.mismatch.noise.estimate import Noise, estimate, first_noise, unexplained, with_usual_forces
from identification.mismatch.noise.friction import dry_level
from identification.mismatch.noise.nuisance import Direction, directions
from identification.mismatch.selection.evaluate import evaluate
from identification.mismatch.selection.linear import Linear, linearise
from identification.mismatch.selection.optima import WORTH, fit_candidates
from identification.mismatch.selection.ripples import ripples
from identification.mismatch.selection.start import Start, candidate_starts

# least force of a free function, for commands as in the handout [V], and over dry friction
_FORCE, _SHARE = 0.05, 0.1


@dataclass(frozen=True, eq=False)
class Account:
    """The residual of a model, told apart.

    Attributes
    ----------
    model
        That leaves it.
    found
        Run-to-run variability around it.
    linear
        All candidates around it.
    noise
        What is nobody's missing physics.
    """

    model: Fit
    found: tuple[Direction, ...]
    linear: Linear
    noise: Noise

    @classmethod
    def of(
        cls, model: Fit, near: Noise | None, phases: Sequence[Direction], candidates: Sequence[Candidate]
    ) -> Account:
        """Tell the residual of a model apart.

        Parameters
        ----------
        near
            Noise of a residual like this one, from which its search begins.
        phases
            Run-to-run variability that has a name already.
        """
        bench, values = model.bench, model.values
        before = first_noise(bench, values) if near is None else near
        found = (*with_secants(bench, values, directions(bench, values), before), *phases)
        linear = sensitivities(bench, before, model, candidates)
        return cls(model, found, linear, estimate(bench, values, model.residual, found, near, linear.common))

    def freed(
        self,
        phases: Sequence[Direction],
        candidates: Sequence[Candidate],
        seen: Callable[[Fit], Sequence[Start]],
    ) -> Account:
        """Return the account with the candidate that explains what unknown forces have taken, if that is more probable.

        Forces and physics that is left out compete for the same residual. Where slow forces are unusually large,
        candidates are fitted with forces of a usual size, and the more probable account of the residual is kept, with its noise:
        in the old one whatever a linear change adds to the new model would count for little.

        Parameters
        ----------
        seen
            From a model to the candidates that the equation error puts first beside it.
        """
        quiet, model = with_usual_forces(self.noise), self.model
        if quiet is None:
            return self
        around = self.linear.around(model, quiet)
        table = evaluate(around, around.residual[:, None])
        order = sorted(table.total, key=lambda n: -float(table.total[n][0]))
        jobs = [
            *candidate_starts(model, around, table, candidates, order, model.bench.settings.proposals),
            *((c, {**model.values, **own}) for c, own in seen(model)),
        ]
        best = min((f for _, f in fit_candidates(model, quiet, jobs).values()), key=lambda f: f.cost, default=model)
        other = Account.of(best, quiet, phases, candidates)
        more = len(best.names) - len(model.names)
        return other if other.noise.cost + WORTH * more < self.noise.cost else self

    def unexplained(self) -> tuple[Noise, FloatArray]:
        """Return the noise, with ripples of the track, and the raw rows that nothing with a name explains, shape (N,)."""
        model, common = self.model, self.linear.common
        left = unexplained(self.noise, model.residual, common)
        more = ripples(self.linear.around(model, self.noise), left)
        if not more:
            return self.noise, left
        return estimate(model.bench, model.values, model.residual, (*self.found, *more), self.noise, common), left


def sensitivities(bench: Bench, noise: Noise, model: Fit, candidates: Sequence[Candidate]) -> Linear:
    """Return the sensitivities of all candidates and of free functions around a model."""
    level = max(dry_level(model.values, c) for c in range(bench.carts))
    return linearise(
        bench, noise, model, candidates, shapes(bench, model.values, max(_FORCE * bench.scale.command, _SHARE * level))
    )

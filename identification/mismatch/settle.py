"""What a model is fitted with on the workbench: weights of its own errors, and the surroundings of its own motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from flexdrive_gym.recording import FloatArray
from identification.mismatch.chance import null_residuals
from identification.mismatch.refit import Coordinates, Fit, judged, refit, sensitivities, with_fresh_sensitivity
from identification.mismatch.screening import orthonormal
from identification.mismatch.surroundings import surroundings
from identification.mismatch.workbench import FRICTION, OFFSET, Workbench

_PUSH_V = 0.02
# draws of nuisance to learn from, and principal directions per recording: others than those that tell what chance reaches
DRAWS, MODES, _SEED = 160, 40, 20
# a model with an error this many times larger moved otherwise
_ANOTHER = 3.0


def settle(
    bench: Workbench, values: Mapping[str, float], names: Sequence[str], plain: Sequence[str] | None = None
) -> Fit:
    """Weigh with the present model's residuals, fit it, and weigh again for what comes next.

    ``plain`` are those of the names that are fitted; effects were fitted where they are seen, and keep their sizes.
    """
    bench.weigh(bench.residual(values))
    values = refit(bench, values, names if plain is None else plain, iterations=6).values
    absorb(bench, values)
    model = with_fresh_sensitivity(bench, values, names)
    if bench.parts:
        return model
    sharpen(bench, model)
    c = Coordinates(names, values)
    model = judged(bench, c, c.of(values), values, bench.residual(values), model.sensitivity)
    if plain is None or len(plain) == len(names):
        return model
    # among plain residuals a rival must beat the best plain fit, not one with sizes from elsewhere
    best = refit(bench, values, names, iterations=6)
    return replace(model, weighted=best.weighted, minimised=best.minimised)


def sharpen(bench: Workbench, model: Fit, draws: int = DRAWS, modes: int = MODES) -> None:
    """Learn from draws of nuisance what it does most, and damp that where residuals are compared.

    Draws around one model serve for the next ones, unless it described another motion.
    """
    error = float(np.sqrt(np.mean(bench.residual(model.values) ** 2)))
    if bench.known is None or error * _ANOTHER < bench.known[0]:
        bench.known = error, null_residuals(bench, model.values, np.random.default_rng(_SEED), draws)
    bench.sharpen(bench.known[1], orthonormal(model.jacobian), modes)


def absorb(bench: Workbench, values: Mapping[str, float]) -> None:
    """Set the weights, and let everything differ that differs on every rig, along the present model's motion."""
    bench.forget_random_effects()
    raw = bench.residual(values)
    bench.weigh(raw)
    if bench.parts:
        # parts of one recording share friction and track
        return
    friction = [n for n in ("d1", "d2")[: len(bench.runs[0].keep)] if values.get(n, 0.0) > 0.0]
    c = Coordinates(friction, values)
    # against a relative change of friction
    c.scale = np.array([max(values[n], 1e-3) for n in friction])
    D = sensitivities(bench, c, c.of(values), values, raw) if friction else np.zeros((len(raw), 0))
    D = np.column_stack([D, bench.pushed(values, [lambda: _ones(bench)], _PUSH_V)])
    priors = [FRICTION] * len(friction) + [OFFSET]
    bench.set_random_effects(bench.weighted(D), bench.weighted(raw), priors)
    forces, sizes = surroundings(bench, values)
    D = np.column_stack([D, bench.pushed(values, forces, _PUSH_V)])
    own = [bench.spread[p.group] for p in priors]
    bench.set_surroundings(bench.weighted(D), np.array([*own, *sizes]))


def _ones(bench: Workbench) -> list[FloatArray]:
    return [np.vstack([np.ones(len(run.u)), np.zeros(len(run.u))]) for run in bench.runs]

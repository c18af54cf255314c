r"""Maximum likelihood: output error on v1 and v2 of all recordings jointly.

Residuals of recording r and cart c are Gaussian with variance :math:`\sigma_{rc}^2 = f_{rc}^2 + \kappa^2`. The floor
:math:`f_{rc}` is what does not repeat between the periods of that very channel (:mod:`identification.floor`); the model
error :math:`\kappa` is common to all channels and estimated with the parameters. The negative log-likelihood

.. math:: \tfrac12 \sum_{r,c} n_{rc} \left(\log \sigma_{rc}^2 + \overline{\varepsilon_{rc}^2(\theta)} / \sigma_{rc}^2\right)

is minimised by least squares weighted with the previous round's variances (L. Ljung, System Identification, 1999, sec.
7.4). Variances free in every channel would reward a wrong model for fitting a few quiet channels to the last bit and
giving up the others. Masses and stiffness are fitted as logarithms, friction within bounds.

Residuals of a real rig are coloured: neighbouring samples are correlated, and friction that differs from run to
run correlates a whole run, so the nominal N overstates what was learnt. The covariance is the sandwich

.. math:: \frac{G}{G-p} H^{-1} \Bigl(\sum_{g=1}^{G} s_g s_g^T\Bigr) H^{-1}, \qquad H = J^T J, \quad s_g = J_g^T r_g,

with the runs as clusters g, and intervals use Student's t with G - p degrees of freedom, since p parameters were fitted
to G independent things. Fewer than p + 2 runs are cut into equal parts. The *effective sample size* is N times the ratio
of nominal to sandwich variance, averaged over the parameters' directions. K.-Y. Liang, S. Zeger, Biometrika 73, 1986.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np
from scipy.stats import t as student

from flexdrive_gym import Covariance, Drive, Provenance, __version__
from flexdrive_gym.drive.parameters import parameter
from flexdrive_gym.recording import FloatArray, Recording
from identification.descent import LOGARITHMIC, Descent
from identification.equation_error import start_values
from identification.quantities import HANDOUT_RATIOS, RATIOS, Quantity, derived_quantities
from identification.recordings import RecordingSet
from identification.replay.output_error import Run, prepare, residuals
from identification.run_to_run import friction_run_to_run, recorded_range
from identification.topology import Topology, topology_of

# rounds of weights, and evaluations in each
_THOROUGH, _QUICK = (3, 30), (2, 8)
_COARSE = 8
# a logarithm this uncertain says nothing, and its exponential is still a number
_UNKNOWN = 300.0
# of a drive whose equations of motion are not all seen, stiffness is known least
_STIFFER = (0.1, 0.3, 3.0, 10.0)
# of a value, standard deviation below which it has none
_NO_VARIANCE = 1e-9
# clusters that a covariance must have beyond the number of parameters
_SPARE = 2
_STOPPED = "the optimiser stopped before its tolerance was met"


@dataclass(frozen=True)
class Channel:
    """Fit of one cart in one recording: rms residual [mm/s] over n valid samples."""

    recording: str
    cart: int
    rms: float
    n: int


@dataclass(frozen=True, eq=False)
class MaximumLikelihood:
    """A fitted drive and what is known about the fit.

    Attributes
    ----------
    drive
        With intervals, covariance and provenance.
    quantities
        The handout's 14 quantities and d1, with intervals.
    ratios
        alpha, beta, gamma with intervals; tied ones have none.
    channels
        Residual per recording and cart.
    rms
        Root mean square residual over all recordings and carts [mm/s].
    effective_samples, samples
        What the coloured residuals are worth, and how many there are.
    starts
        Start name to the negative log-likelihood it led to.
    converged
        Whether the optimiser met its tolerance.
    notes
        Sentences a reader should see, for example parameters at a bound.
    """

    drive: Drive
    quantities: Mapping[str, Quantity]
    ratios: Mapping[str, Quantity]
    channels: tuple[Channel, ...]
    rms: float
    samples: int
    effective_samples: float
    starts: Mapping[str, float]
    converged: bool
    notes: tuple[str, ...] = field(default=())

    def __str__(self) -> str:
        units = self.drive.units
        lines = [f"maximum likelihood fit of {len({c.recording for c in self.channels})} recordings"]
        lines += [f"  {name:8s} {q.of_rig(units)}" for name, q in {**self.quantities, **self.ratios}.items()]
        lines.append(
            f"  rms residual {units.text(self.rms, 'mm/s', 3)} over {self.samples} samples, worth {self.effective_samples:.0f} "
            "independent ones"
        )
        return "\n".join([*lines, *(f"  note: {note}" for note in self.notes)])


def identify_by_likelihood(
    recordings: Sequence[Recording],
    *,
    ties: Mapping[str, float] | None = None,
    fixed: Mapping[str, float] | None = None,
    start: Mapping[str, float] | None = None,
    damping: bool = False,
    threads: int | None = None,
    topology: Topology | None = None,
    quick: bool = False,
) -> MaximumLikelihood:
    """Fit the drive to all recordings at once.

    Parameters
    ----------
    recordings
        Of one drive; open-loop ones are used, closed-loop ones only if there is nothing else.
    ties
        Any of ``alpha`` (m2/m1), ``beta`` (b2/b1), ``gamma`` (d2/d1) held at a value; none by default.
    fixed
        Parameters to hold, for example ``{"saturation.limit": 8.0}``; they become part of the drive.
    start
        One more start besides those found from the data.
    damping
        Whether to fit the spring's damping C too (the handout assumes 0).
    threads
        Threads for the simulations; default: the processors this process may use. The answer does not depend on it.
    topology
        Which bodies there are and what is free; default: one cart or two, as the recordings' channels or their rig description
        tell, with the effects that it knows.

    Returns
    -------
    MaximumLikelihood

    Raises
    ------
    ValueError
        If no recording can be used, or a tie is unknown; the message says what to record or to pass.
    """
    ties = dict(ties or {})
    for name in ties:
        if name not in RATIOS:
            raise ValueError(f"ties: must be among {', '.join(RATIOS)}; got {name!r}.")
    used, notes = usable(recordings)
    used.sort(key=_place)
    runs = [prepare(r) for r in used]
    topology = topology or topology_of(RecordingSet(used, rig=getattr(recordings, "rig", None)))
    fixed = {**topology.fixed, **(fixed or {})}
    tied = {RATIOS[r][0] for r in ties}
    names = [n for n in (*topology.free, *(["C"] if damping else [])) if n not in tied and n not in fixed]
    found = {**topology.start, **start_values(used, topology)}
    known = {n: found[n] for n in topology.start if "." in n}
    begin = {n: v for n, v in {"C": 1e-5, **_positive(found), **known, **fixed}.items() if n in {*names, *tied, *fixed}}
    with ThreadPoolExecutor(threads or len(os.sched_getaffinity(0))) as pool:
        # a few recordings tell which start leads to the best valley; all of them then find its bottom
        some = runs[:: max(1, round(len(runs) / (_COARSE // 2 if quick else _COARSE)))]
        coarse = Descent(some, names, ties, fixed, pool)
        tried = {label: coarse.descend(values, 1, 8) for label, values in _starts(begin, start, topology).items()}
        best = min(tried, key=lambda label: tried[label][1])
        fit = Descent(runs, names, ties, fixed, pool)
        z, cost, done, _values = fit.descend(tried[best][3], *(_QUICK if quick else _THOROUGH))
        costs = {label: float(item[1]) for label, item in tried.items()} | {f"{best}, refined": float(cost)}
        return _result(fit, z, used, costs, notes if done else [*notes, _STOPPED])


def _place(recording: Recording) -> tuple[str, float, float, tuple[float, ...]]:
    """Return where a recording comes in a fit: by what was done and what came of it, whatever its file is called."""
    drove = recording.excitation
    moved = tuple(float(f"{np.abs(y).sum():.6g}") for _, y in recording.channels())
    return drove.kind, round(drove.frequency, 4), round(drove.amplitude, 4), moved


def _starts(
    begin: Mapping[str, float], given: Mapping[str, float] | None, topology: Topology
) -> dict[str, dict[str, float]]:
    starts = {"equation error": dict(begin)}
    if given is not None:
        starts["given"] = {**begin, **_positive(given)}
    if not topology.two_carts:
        starts |= {f"stiffness times {f:g}": {**begin, "k": f * begin["k"]} for f in _STIFFER if "k" in topology.free}
    elif "k" in begin:
        # the split of mass and friction between the carts is what the equations of motion know worst
        starts["heavier cart 2"] = {**begin, "m2": 1.5 * begin["m2"], "k": 1.3 * begin["k"]}
        starts["handout ratios"] = {
            **begin,
            **{dependent: HANDOUT_RATIOS[r] * begin[free] for r, (dependent, free) in RATIOS.items()},
            "k": 1.2 * begin["k"],
        }
    return starts


def _positive(values: Mapping[str, float]) -> dict[str, float]:
    masses = [v for n, v in values.items() if n in {"m1", "m2"} and v > 0.0] or [1e-3]
    small = {"m": 0.2 * max(masses), "k": 0.05, "b": 0.0, "d": 0.0, "C": 0.0}
    return {n: v if v > 0.0 else small.get(n[0], 0.0) for n, v in values.items()}


def usable(recordings: Sequence[Recording]) -> tuple[list[Recording], list[str]]:
    """Return the recordings a fit can use, and a sentence for each kind left out.

    Raises
    ------
    ValueError
        If nothing is left.
    """
    single = [r for r in recordings if not any(f.id == "duplicate_recording" for f in r.faults)]
    good = [r for r in single if not r.held]
    open_loop = [r for r in good if not r.closed_loop]
    notes = []
    if len(single) < len(recordings):
        notes.append(f"{_counted(len(recordings) - len(single), 'duplicate recording')} left out")
    if len(good) < len(single):
        held = _counted(len(single) - len(good), "recording")
        notes.append(f"{held} with a held cart left out: the model has two carts that move")
    if open_loop:
        if len(open_loop) < len(good):
            notes.append(f"{_counted(len(good) - len(open_loop), 'closed-loop recording')} kept for validation")
        return open_loop, notes
    if not good:
        raise ValueError(
            "recordings: needs at least one run of the drive; got none. Record squares and sines (2.5, 2.6)."
        )
    notes.append("only closed-loop recordings: their recorded command is replayed, which drifts with friction")
    return good, notes


def _counted(n: int, what: str) -> str:
    return f"{n} {what}{'' if n == 1 else 's'}"


def _parts(runs: int, parameters: int) -> int:
    """Return into how many parts every run is cut so that there are enough clusters; 1 where the runs are enough."""
    return -(-(parameters + _SPARE) // runs)


def _covariance(fit: Descent, z: FloatArray) -> tuple[FloatArray, float, int]:
    """Sandwich covariance of z, effective sample size, and number of clusters."""
    J, r = fit.jacobian(z), fit.residuals(z)
    scores = J * r[:, None]
    parts, n = _parts(len(fit.runs), len(z)), len(z)
    clusters = parts * len(fit.runs)
    s, begin = np.zeros((clusters, n)), 0
    for i, run in enumerate(fit.runs):
        length = len(run.u) * run.sample_time
        for c in range(len(run.keep)):
            # both carts belong together: they share the disturbance
            part = (parts * run.block_times(c) / length).astype(int)
            np.add.at(s, parts * i + part, scores[begin : begin + len(part)])
            begin += len(part)
    # a parameter without influence makes the information singular; the pseudo-inverse gives it no variance here and
    # the caller says that nothing is known of it
    inverse = np.linalg.pinv(J.T @ J, rcond=1e-12, hermitian=True)
    sandwich = inverse @ (s.T @ s) @ inverse * (clusters / (clusters - n))
    ratio = np.diag(inverse) / np.maximum(np.diag(sandwich), 1e-300)
    samples = sum(int(k.sum()) for run in fit.runs for k in run.keep)
    return sandwich, float(samples * np.exp(np.mean(np.log(np.maximum(ratio, 1e-12))))), clusters


def _result(
    fit: Descent, z: FloatArray, used: Sequence[Recording], costs: Mapping[str, float], notes: Sequence[str]
) -> MaximumLikelihood:
    values = fit.values(z)
    channels = channel_fits(values, fit.runs, fit.pool)
    n = sum(c.n for c in channels)
    rms = float(np.sqrt(sum(c.n * c.rms**2 for c in channels if c.n) / n))
    covariance_z, effective, clusters = _covariance(fit, z)
    gain = np.where(fit.log, np.exp(np.where(fit.log, z, 0.0)), fit.scale)
    covariance = covariance_z * np.outer(gain, gain)
    quantile = float(student.ppf(0.975, clusters - len(z)))
    spread = quantile * np.sqrt(np.diag(covariance))
    intervals = {
        # masses and stiffness were fitted as logarithms, so their intervals are ratios
        name: (float(v * np.exp(-s / v)), float(v * np.exp(min(s / v, _UNKNOWN))))
        if name in LOGARITHMIC
        else (max(parameter(name).lower, float(v - s)), float(v + s))
        for name, v, s in zip(fit.names, (values[n] for n in fit.names), spread, strict=True)
    }
    # what made no difference was given no variance: nothing is known of it
    blind = spread <= _NO_VARIANCE * np.abs([values[n] for n in fit.names])
    intervals |= {
        n: (parameter(n).lower, parameter(n).upper) for n, nothing in zip(fit.names, blind, strict=True) if nothing
    }
    remarks = list(notes)
    unknown = [n for n, (low, high) in intervals.items() if high - low > 2.0 * values[n]]
    if unknown:
        remarks.append(
            f"{', '.join(unknown)}: not identifiable from these recordings (the interval is wider than twice the value); "
            "add squares at two amplitudes and sines around the resonance"
        )
    remarks += [
        f"{n} rests at its bound 0"
        for n in fit.names
        if n not in LOGARITHMIC and parameter(n).lower == 0.0 and values[n] < 1e-8
    ]
    remarks += [
        f"{n} rests at its bound {values[n]:.1g}: the model lacks something that these recordings have"
        for n in fit.resting(z)
    ]
    if _parts(len(used), len(z)) > 1:
        few = f"with fewer than {len(z) + _SPARE} recordings (here {len(used)})"
        remarks.append(f"{few} the intervals hold little of what differs from run to run")
    drive = Drive(
        values,
        intervals,
        Covariance(fit.names, covariance, clusters - len(z)),
        Provenance("ml", tuple(r.name for r in used), __version__, "; ".join(remarks)),
        name="identified drive",
        units=used[0].units,
        run_to_run=friction_run_to_run(values, fit.runs, fit.pool),
        recorded=recorded_range(used),
    )
    whole = drive.carts == 1 or {"m1", "m2", "b1", "b2", "k"} <= set(values)
    quantities, ratios = derived_quantities(drive, fit.ties, quantile) if whole else ({}, {})
    done = _STOPPED not in remarks
    return MaximumLikelihood(
        drive, quantities, ratios, tuple(channels), rms, n, effective, dict(costs), done, tuple(remarks)
    )


def channel_fits(
    values: Mapping[str, float], runs: Sequence[Run], pool: ThreadPoolExecutor | None = None
) -> list[Channel]:
    """Return the rms residual of every run and cart over its valid samples."""
    parts = residuals(values, runs, pool)
    keys = [(run, c) for run in runs for c in range(len(run.keep))]
    return [
        Channel(
            run.name,
            c + 1,
            float(np.sqrt(np.mean(r[run.keep[c]] ** 2))) if run.keep[c].any() else float("nan"),
            int(run.keep[c].sum()),
        )
        for (run, c), r in zip(keys, parts, strict=True)
    ]


def improvement(before: MaximumLikelihood, after: MaximumLikelihood) -> float:
    """Return by which share the squared error fell, 0…1 (negative if it rose)."""
    return 1.0 - (after.rms / before.rms) ** 2

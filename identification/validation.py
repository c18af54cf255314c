r"""Does the model hold? Overlays, fits and residual tests (handout 3.3).

Open-loop runs are replayed with their recorded command; closed-loop runs are simulated *in the loop*, with the gain
and feedback found in the data, because a free replay of their command drifts with any friction error. Where the controller is
unknown, and where a run begins in motion without a command, short windows are replayed, each begun in the measured state
(:mod:`identification.prediction`). Recordings with a held cart, and those whose command is a reference, are left out. Figures of
merit per channel y against its simulation ŷ:

* rms of y - ŷ, beside the floor no single model can undercut;
* NRMSE fit :math:`1 - \|y - \hat y\| / \|y - \bar y\|` and VAF :math:`1 - \mathrm{var}(y - \hat y) / \mathrm{var}(y)`;
* whiteness: the Ljung-Box test on the residual in blocks of 5 ms, and the share of its autocorrelations outside the 99 %
  band of white noise (G. Ljung, G. Box, Biometrika 65, 1978);
* cross-correlation of the residual with the command's past against the band :math:`\pm 2.58 \sqrt{P/N}`,
  :math:`P = \sum_\tau R_\varepsilon(\tau) R_u(\tau)` (L. Ljung, System Identification, 1999, sec. 16.6).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import correlate
from scipy.stats import chi2

from flexdrive_gym import Drive, PControl, Recording
from flexdrive_gym.drive.default import HANDOUT_LIMIT_V
from flexdrive_gym.recording import BoolArray, FloatArray
from flexdrive_gym.units import LAB, Units
from identification.experiment import silent
from identification.floor import measure_floor
from identification.prediction import predict, window_of
from identification.replay.output_error import BLOCK_S, Run, prepare, simulate_run
from identification.selection import select

_LAGS = 40
_NORMAL_99 = 2.58


@dataclass(frozen=True)
class ChannelFit:
    """How one channel of one recording is reproduced.

    Attributes
    ----------
    rms, floor
        Of the residual and of what no model can explain [unit]; the floor is nan where nothing repeats.
    how
        What was simulated: ``replay`` of the command, ``in the loop``, or ``windows of … s``.
    nrmse, vaf
        Fit by norm and by variance, 1 is perfect; nan where the channel does not move.
    whiteness
        p-value of the Ljung-Box test; small: the residual has structure left.
    correlated
        Share of autocorrelations outside the 99 % band.
    input_correlation
        Largest cross-correlation with the command's past over its 99 % band; above 1: the command still explains
        part of the residual.
    """

    recording: str
    channel: str
    unit: str
    rms: float
    floor: float
    nrmse: float
    vaf: float
    whiteness: float
    correlated: float
    input_correlation: float
    how: str = "replay"

    def of_rig(self, units: Units) -> ChannelFit:
        """Return the fit as the rig's owner reads it."""
        one = units.one(self.unit)
        return replace(self, rms=self.rms / one, floor=self.floor / one, unit=units.name(self.unit))


@dataclass(frozen=True, eq=False)
class Overlay:
    """A measured recording and its simulation on the same instants."""

    measured: Recording
    simulated: Recording
    fits: tuple[ChannelFit, ...]
    how: str = "replay"


@dataclass(frozen=True, eq=False)
class Validation:
    """All overlays of a data set.

    Attributes
    ----------
    overlays
        One per recording.
    rms, floor
        Over all open-loop velocity channels [mm/s]; the floor over those where it could be measured. nan where there are none.
    notes
        What was left out, and how closed loops of an unknown controller were simulated.
    """

    overlays: tuple[Overlay, ...]
    rms: float
    floor: float
    notes: tuple[str, ...] = ()

    @property
    def units(self) -> Units:
        """The rig's units."""
        return self.overlays[0].measured.units if self.overlays else LAB

    def fits(self) -> tuple[ChannelFit, ...]:
        """Return every channel's fit."""
        return tuple(f for overlay in self.overlays for f in overlay.fits)

    def summary(self) -> str:
        """Say how far all velocities are off, and what of that no model can explain; or why there is no such figure."""
        u = self.units
        if not np.isfinite(self.rms):
            return "no velocity was recorded in open loop, so there is no rms over all velocities"
        text = f"all velocities: rms {u.text(self.rms, 'mm/s', 3)}"
        if not np.isfinite(self.floor):
            return f"{text}; no floor, because no run repeats itself"
        return f"{text}, floor {u.text(self.floor, 'mm/s', 3)}"

    def __str__(self) -> str:
        u = self.units
        lines = [f"{'recording':34s} channel      rms    floor   NRMSE     VAF  how"]
        lines += [
            f"{f.recording:34s} {f.channel:7s} {_cell(f.rms, '.3g'):>8s} {_cell(f.floor, '.3g'):>8s} "
            f"{_cell(f.nrmse, '.1%'):>7s} {_cell(f.vaf, '.1%'):>7s}  {f.how}"
            for f in (f.of_rig(u) for f in self.fits())
        ]
        return "\n".join([*lines, *(f"note: {note}" for note in self.notes), self.summary()])


def _cell(value: float, form: str) -> str:
    """Return a number for a table; a dash where there is none."""
    return format(value, form) if np.isfinite(value) else "–"


def simulate_like(drive: Drive, recording: Recording) -> Recording:
    """Simulate what a recording did: replay of u in open loop, in the loop for P-control.

    Velocities pass the recording's own processing, without encoder counts.
    """
    if recording.closed_loop and recording.xr is not None and recording.excitation.gain is not None:
        feedback = recording.excitation.feedback or "x2"
        limit = (
            {}
            if "saturation.limit" in drive.values
            else {"saturation.limit": recording.excitation.limit or HANDOUT_LIMIT_V}
        )
        start = [0.0 if x is None else float(x[0]) for x in (recording.x1, recording.x2)]
        return drive.replace(limit).simulate_closed_loop(
            recording.t,
            recording.xr,
            PControl(recording.excitation.gain, feedback),
            start=(start[0], 0.0, start[1], 0.0),
            name=recording.name,
        )
    run = prepare(recording)
    v = simulate_run(drive.values, run)
    places = _replayed_positions(drive, recording, run)
    return Recording(
        recording.name,
        recording.t,
        recording.u,
        x1=places.get("x1"),
        x2=places.get("x2"),
        v1=v[0],
        v2=v[1] if len(v) > 1 else None,
        source="simulated",
    )


def _replayed_positions(drive: Drive, recording: Recording, run: Run) -> dict[str, FloatArray]:
    """Return simulated positions where nothing else was recorded, from where the run began."""
    given = (recording.x1, recording.x2)
    if recording.v1 is not None or recording.v2 is not None:
        return {}
    if _held_by_the_frame(drive, given):
        # anchored to where the carts were, the spring would pull as it did there, and nothing would bring a simulated cart back
        run = replace(run, track=np.full_like(run.track, np.nan))
    places = simulate_run(drive.values, replace(run, positions=True))
    return {
        f"x{cart + 1}": x_hat + (x[0] - x_hat[0])
        for cart, (x, x_hat) in enumerate(zip(given, places, strict=False))
        if x is not None
    }


def _held_by_the_frame(drive: Drive, positions: Sequence[FloatArray | None]) -> bool:
    """Whether a spring to the frame pulls harder than dry friction holds somewhere along a run."""
    stiffness = [drive.values.get(f"ground_spring.{name}", 0.0) for name in ("kg", "kg_2")]
    pull = sum(k * float(np.max(np.abs(x - x[0]))) for k, x in zip(stiffness, positions, strict=True) if x is not None)
    return pull > sum(drive.values.get(name, 0.0) for name in ("d1", "d2"))


def validate(drive: Drive, recordings: Sequence[Recording]) -> Validation:
    """Compare a drive with recordings.

    Parameters
    ----------
    drive
        The model.
    recordings
        Open-loop and P-control runs, best those the drive was not fitted to.

    Returns
    -------
    Validation
    """
    selection = select(recordings)
    runs = [r for r in recordings if selection.reasons.get(r.name) not in ("held", "reference")]
    if not runs:
        selection.require()
    floors = {(f.recording, f.cart): f.rms for f in measure_floor(runs)}
    overlays = []
    squares, floor_squares, n, floor_n = 0.0, 0.0, 0, 0
    for measured in runs:
        simulated, how = simulate_recording(drive, measured)
        fits = []
        for name, y in measured.channels():
            y_hat = getattr(simulated, name)
            whole = how == "replay"
            positions = measured.x1 is not None or measured.x2 is not None
            if y_hat is None or (not whole and positions and name.startswith("v")):
                continue
            keep = measured.valid(name)
            floor = floors.get((measured.name, int(name[1])), float("nan")) if name.startswith("v") else float("nan")
            fit = replace(_fit(measured, name, y, y_hat, keep, floor), how=how)
            fits.append(fit)
            if name.startswith("v") and keep.any() and whole:
                squares, n = squares + fit.rms**2 * keep.sum(), n + int(keep.sum())
                if np.isfinite(floor):
                    floor_squares, floor_n = floor_squares + floor**2 * keep.sum(), floor_n + int(keep.sum())
        overlays.append(Overlay(measured, simulated, tuple(fits), how))
    left_out = tuple(note for note in selection.notes if "held" in note or "reference" in note)
    return Validation(
        tuple(overlays),
        float(np.sqrt(squares / n)) if n else float("nan"),
        float(np.sqrt(floor_squares / floor_n)) if floor_n else float("nan"),
        (*left_out, *_how_notes(overlays)),
    )


def simulate_recording(drive: Drive, measured: Recording) -> tuple[Recording, str]:
    """Return what the drive does where a recording was made, and how that was simulated.

    Returns
    -------
    simulated : Recording
        Only signals that can be compared.
    how : str
        ``replay`` of the command, ``in the loop``, or ``windows of … s`` where the controller is unknown.
    """
    unknown = measured.closed_loop and (measured.xr is None or measured.excitation.gain is None)
    if unknown or silent(measured):
        seconds = window_of(drive)
        return predict(drive, measured, seconds), f"windows of {measured.units.text(seconds, 's', 2)}"
    return simulate_like(drive, measured), "in the loop" if measured.closed_loop else "replay"


def _how_notes(overlays: Sequence[Overlay]) -> tuple[str, ...]:
    names = [o.measured.name for o in overlays if o.how.startswith("windows")]
    if not names:
        return ()
    listed = ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
    how = next(o.how for o in overlays if o.how.startswith("windows"))
    note = (
        f"{listed}: the controller is unknown, or there was no command; replayed over {how}, each begun in the measured state, "
        "because a replay of the whole run drifts with any error of friction"
    )
    return (note,)


def _fit(
    recording: Recording, name: str, y: FloatArray, y_hat: FloatArray, keep: BoolArray, floor: float
) -> ChannelFit:
    unit = "mm/s" if name.startswith("v") else "mm"
    if not keep.any():
        nan = float("nan")
        return ChannelFit(recording.name, name, unit, nan, floor, nan, nan, nan, nan, nan)
    e, reference = (y - y_hat)[keep], y[keep]
    moved = float(np.std(reference)) > 0.0
    whiteness, correlated = whiteness_test(_blocks(recording, y - y_hat, keep))
    return ChannelFit(
        recording.name,
        name,
        unit,
        float(np.sqrt(np.mean(e**2))),
        floor,
        1.0 - float(np.linalg.norm(e) / np.linalg.norm(reference - reference.mean())) if moved else float("nan"),
        1.0 - float(np.var(e) / np.var(reference)) if moved else float("nan"),
        whiteness,
        correlated,
        input_correlation(_blocks(recording, y - y_hat, keep), _blocks(recording, recording.u, keep)),
    )


def _blocks(recording: Recording, values: FloatArray, keep: BoolArray) -> FloatArray:
    """Means over 5 ms; a block with a fault is set to the mean, which adds no correlation of its own."""
    width = max(1, round(BLOCK_S / recording.sample_time))
    n = len(values) // width
    inside = keep[: n * width].reshape(n, width).all(axis=1)
    means = values[: n * width].reshape(n, width).mean(axis=1)
    centre = float(means[inside].mean()) if inside.any() else 0.0
    return np.where(inside, means - centre, 0.0)


def autocorrelation(e: FloatArray, lags: int) -> FloatArray:
    """Return the normalised autocorrelation at lags 1 … ``lags``, ndarray, shape (lags,); 0 for a zero signal."""
    full = correlate(e, e, method="fft")[len(e) - 1 :]
    return np.asarray(full[1 : lags + 1] / full[0]) if full[0] > 0.0 else np.zeros(lags)


def whiteness_test(e: FloatArray, lags: int = _LAGS) -> tuple[float, float]:
    """Return the Ljung-Box p-value and the share of autocorrelations outside the 99 % band.

    Parameters
    ----------
    e : ndarray, shape (n,)
        Residuals.
    lags
        Number of lags tested.
    """
    n = len(e)
    lags = min(lags, n - 2)
    if lags < 1:
        return float("nan"), float("nan")
    rho = autocorrelation(e, lags)
    statistic = n * (n + 2) * float(np.sum(rho**2 / (n - 1 - np.arange(lags))))
    return float(chi2.sf(statistic, lags)), float(np.mean(np.abs(rho) > _NORMAL_99 / np.sqrt(n)))


def input_correlation(e: FloatArray, u: FloatArray, lags: int = _LAGS) -> float:
    """Return the largest |cross-correlation| of e with u's past over its 99 % band."""
    n = len(e)
    scale = float(np.linalg.norm(e) * np.linalg.norm(u))
    if scale == 0.0 or n < 4:
        return 0.0
    cross = correlate(e, u, method="fft")[n - 1 : n - 1 + min(lags, n - 1)] / scale
    rho_e, rho_u = autocorrelation(e, n - 1), autocorrelation(u, n - 1)
    spread = max(1.0 + 2.0 * float(np.sum(rho_e * rho_u)), 1.0)
    return float(np.max(np.abs(cross)) / (_NORMAL_99 * np.sqrt(spread / n)))

"""The tables of a comparison, as text for terminals and as cells for pages."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import isfinite

from baselines.compare.result import Result
from baselines.evaluation.proportions import Share
from baselines.loop_analysis.empirical_margins import SWING_MM
from flexdrive_gym import Drive
from flexdrive_gym.units import LAB, Units, in_rig_units

# which margin is which, wherever one is shown
LINEAR = (
    "GM linear, PM linear, delay linear: margins of the sampled linear loop, broken at the command (GM upward: the factor by "
    "which the loop gain may be raised)."
)
BY_TRIAL = "By trial: the same limits found by simulating the linear drive."


def with_friction(units: Units = LAB) -> str:
    """Say what a margin with friction is."""
    return (
        "With friction: simulated with friction, encoder counts and command limit, how much the gain may be raised or the "
        f"command be late until x2 swings more than {units.text(SWING_MM, 'mm')} in the last six of twelve seconds after a move, "
        "or the command is at its limit for a tenth of them. It is larger where friction stops what the linear loop would let "
        "grow."
    )


@dataclass(frozen=True)
class Table:
    """A title, names of columns with units in brackets, rows of cells."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    def of_rig(self, units: Units) -> Table:
        """Return the table with the rig's names of units in its head; its cells are the rig's already."""
        return replace(self, title=units.label(self.title), columns=tuple(map(units.label, self.columns)))

    def __str__(self) -> str:
        grid = [self.columns, *self.rows]
        widths = [max(len(row[i]) for row in grid) for i in range(len(self.columns))]
        lines = [
            "  ".join(_placed(cell, w, i) for i, (cell, w) in enumerate(zip(row, widths, strict=True))) for row in grid
        ]
        return "\n".join([self.title, *(line.rstrip() for line in lines)])


def _placed(cell: str, width: int, column: int) -> str:
    return cell.ljust(width) if column == 0 else cell.rjust(width)


def figure(value: float | None, digits: int = 4) -> str:
    """Return a number for a cell; a dash where there is none."""
    return "–" if value is None or not isfinite(value) else f"{value:.{digits}g}"


def share_cell(share: Share | None) -> str:
    """Return a share with its interval for a cell."""
    return "–" if share is None else f"{share.value:.1%} ({share.low:.1%} … {share.high:.1%})"


def loop_words(result: Result, units: Units = LAB) -> str:
    """Say what a loop does: in linear theory, and simulated with friction, counts and limit; figures are the rig's."""
    linear = "" if result.margins is None else f"linearly {'stable' if result.margins.stable else 'unstable'}; "
    return linear + doing(result.nominal.stable, result.swing, units)


def doing(bounded: bool, swing: float | None, units: Units = LAB) -> str:
    """Say what a simulated loop does after a move, from the swing of a cart that stays.

    Parameters
    ----------
    bounded
        Whether the run stayed within bounds.
    swing
        As the rig's owner reads it; ``None`` where it is not known.
    units
        The rig's.
    """
    if not bounded or (swing is not None and not isfinite(swing)):
        return "grows"
    if swing is None:
        return "does not grow"
    least = LEAST_SWING_MM / units.one("mm")
    return "comes to rest" if swing < least else f"limit cycle of {swing:.2g} {units.length} with friction"


# below, what is left of a vibration is a few encoder counts
LEAST_SWING_MM = 0.1


def _setting(drive: Drive, limit: float) -> str:
    """Say on what controllers run; ``limit`` is the comparison's, which the drive's own may undercut."""
    return f"on “{drive.name}”, simulated, ±{min(limit, drive.voltage_limit):.4g} {drive.units.command}"


def overview_table(drive: Drive, limit: float, results: Sequence[Result]) -> Table:
    """Return what matters most of some controllers in a few columns, no wider than 80 characters; figures as they are given."""
    return Table(
        _setting(drive, limit),
        ("controller", "rms e [mm]", "peak [mm]", "settles", "on draws", "vibration [V mm]", "GM linear", "GM with friction"),
        tuple(
            (r.entry.name, figure(m.rms, 3), figure(m.peak, 3), "yes" if m.success else "no",
             "–" if r.draws is None else f"{r.draws.value:.0%}", figure(m.vibration, 2),
             figure(None if r.margins is None else r.margins.gain_margin, 3),
             figure(None if r.on_rig is None else r.on_rig.gain_margin, 3))
            for r in results for m in [r.nominal]
        ),
    )  # fmt: skip


def tracking_table(drive: Drive, limit: float, results: Sequence[Result]) -> Table:
    """Return the measures along the handout's trajectory on the identified drive, figures as they are given."""
    return Table(
        f"tracking {_setting(drive, limit)}",
        ("controller", "reads", "rms e [mm]", "peak [mm]", "settling [s]", "overshoot [%]", "vibration [V mm]", "rms u [V]",
         "peak u [V]"),
        tuple(
            (r.entry.name, r.entry.feedback, figure(m.rms, 3), figure(m.peak, 3), figure(m.settling, 2), figure(m.overshoot, 2),
             figure(m.vibration, 2), figure(m.effort, 3), figure(m.effort_peak, 3))
            for r in results for m in [r.nominal]
        ),
    )  # fmt: skip


def margins_table(results: Sequence[Result], units: Units) -> Table:
    """Return the margins, each by its name; figures as they are given, in the rig's ``units``."""
    return Table(
        "margins of the sampled linear loop (in brackets: by trial), and simulated with friction and limit",
        ("controller", "GM linear", "PM linear [deg]", "delay linear [ms]", "disk", "peak |S|", "rejection [V/mm]",
         "GM with friction", "delay with friction [ms]", "loop"),
        tuple(
            (r.entry.name, _pair(None if m is None else m.gain_margin, None if e is None else e.gain_margin),
             figure(None if m is None else m.phase_margin_deg, 3),
             _pair(None if m is None else 1e3 * m.delay_margin, None if e is None else 1e3 * e.delay_margin),
             figure(None if m is None else m.disk_margin, 2), figure(None if m is None else m.sensitivity_peak, 3),
             figure(None if m is None else m.stiffness, 3), figure(None if f is None else f.gain_margin, 4),
             figure(None if f is None else 1e3 * f.delay_margin, 4), loop_words(r, units))
            for r in results for m, e, f in [(r.margins, r.empirical, r.on_rig)]
        ),
    )  # fmt: skip


def robustness_table(results: Sequence[Result]) -> Table:
    """Return shares of success over drawn drives and left-out effects."""
    return Table(
        "robustness",
        ("controller", "stable over draws", "success over draws", "rms e, 5 … 95 % [mm]", "effects survived"),
        tuple(
            (r.entry.name, share_cell(r.stable_draws), share_cell(r.draws),
             "–" if r.draw_rms is None else f"{r.draw_rms[0]:.3g} … {r.draw_rms[2]:.3g}",
             "–" if r.effect_share is None else f"{r.effect_share.hits} of {r.effect_share.trials}")
            for r in results
        ),
    )  # fmt: skip


def drives_table(found: Sequence[tuple[str, Drive, Sequence[Result]]]) -> Table:
    """Return controllers on several drives: a row each, and columns for every drive.

    Parameters
    ----------
    found
        Label of a drive, the drive, and what was found on it.
    """
    names = dict.fromkeys(r.entry.name for _label, _drive, results in found for r in results)
    rows = []
    for name in names:
        row = [name]
        for _label, drive, results in found:
            r = next((r for r in results if r.entry.name == name), None)
            if r is None:
                row += ["–"] * 4
                continue
            r = in_rig_units(r, drive.units)
            gain = None if r.margins is None else r.margins.gain_margin
            rig = None if r.on_rig is None else r.on_rig.gain_margin
            row += [figure(r.nominal.rms, 3), "yes" if r.nominal.success else "no", figure(gain), figure(rig)]
        rows.append(tuple(row))
    head = [
        drive.units.label(f"{label}: {what}")
        for label, drive, _results in found
        for what in ("rms e [mm]", "settles", "GM linear", "GM with friction")
    ]
    return Table("side by side", ("controller", *head), tuple(rows))


def _pair(analytic: float | None, by_trial: float | None) -> str:
    return figure(analytic, 4) + ("" if by_trial is None else f" ({figure(by_trial, 4)})")

"""The sections of the report, each a function of the findings."""

from __future__ import annotations

from dataclasses import replace
from math import pi

from baselines.lab.experiments import STABLE_GAIN, stability_experiments
from baselines.loop_analysis.stability_limit import ObservedLimit, explain
from baselines.report import discussion, words
from baselines.report.fault_table import add_faults, shaded
from baselines.report.findings import Findings
from baselines.report.page import Section
from flexdrive_gym import Recording
from flexdrive_gym.units import Units
from identification import Identification, Validation
from identification.quantities import HANDOUT_RATIOS, Quantity
from identification.recordings.faults import gathered
from identification.step_response import HandoutResult
from identification.validation import Overlay


def measured_limit(observed: ObservedLimit, units: Units) -> str:
    """Say what the recorded runs tell of the limit; empty if nothing."""
    if observed.holds is None and observed.grows is None:
        return ""
    if observed.grows is None and observed.holds is not None:
        return f" On the rig {units.text(observed.holds, 'V/mm')} held, and no larger gain was tried."
    if observed.holds is None and observed.grows is not None:
        return f" On the rig {units.text(observed.grows, 'V/mm')} was unstable, and no smaller gain was tried."
    assert observed.holds is not None
    assert observed.grows is not None
    return f" On the rig {units.text(observed.holds, 'V/mm')} held and {units.text(observed.grows, 'V/mm')} grew."


def faults(found: Findings) -> Section:
    """List the data faults."""
    section = Section("Sensor faults", "faults")
    section.folded = True
    shown = gathered([f for r in found.recordings for f in r.faults])
    if shown:
        section.title = f"Sensor faults: {len(shown)} in {len({f.recording for f in shown})} recordings"
        section.text(
            "These samples are data faults, not physics: they are shaded in the plots and left out of every fit. (The command at "
            "its limit is listed and shaded too, and kept.)"
        )
        add_faults(section, shown)
    else:
        section.text(
            "None found: no encoder froze while the other cart moved, no counts were lost, no recording is a copy."
        )
    notes = [f"{r.name}: {note}" for r in found.recordings for note in r.notes]
    if notes:
        section.items(notes)
    return section


def p_control_section(found: Findings) -> Section:
    """Show the P-control runs (2.1-2.4) and answer the two questions."""
    from identification.plots import plot_recording  # noqa: PLC0415  (matplotlib)

    section = Section("P-control (2.1–2.4)", "p-control")
    runs = [r for r in found.task_runs if r.closed_loop and r.x2 is not None and r.excitation.gain is not None]
    drive = found.task
    if drive.carts == 1:
        section.text("There is no second cart to control.")
        return section
    feedbacks = [r.excitation.feedback for r in runs]
    if feedbacks.count("x2") < 2 or "x1" not in feedbacks:
        have = "No P-control run was" if not runs else f"Only {len(runs)} of the four P-control runs (2.1–2.4) "
        was = "" if not runs else "was " if len(runs) == 1 else "were "
        section.text(f"{have}{was} recorded; those named “simulated” are the identified drive's.".replace("  ", " "))
        runs += [
            replace(r, name=f"simulated: {r.name}")
            for r in stability_experiments(drive).values()
            if not any(_same_run(r, q) for q in runs)
        ]
    units = drive.units
    order = sorted(runs, key=lambda r: (r.excitation.feedback == "x1", r.excitation.gain or 0.0))
    measures = [discussion.measure_p_control(r) for r in order]
    section.heading("What is the effect of changing the P-control gain in non-collocated control?")
    section.items(discussion.effect_of_gain(measures, drive, found.limits.get("x2")))
    section.heading("What are the advantages and disadvantages of collocated control?")
    section.items(discussion.collocation(measures, drive))
    section.heading("The runs")
    section.table(
        [units.name(name) for name in (
            "run", "feedback", "Kp [V/mm]", "rms e [mm]", "peak |e| [mm]", "|e| in dwells [mm]", "x2 swing in dwells [mm]",
            "grows",
        )],
        [
            (m.name, m.feedback, f"{m.gain / units.one('V/mm'):.4g}", *(f"{x / units.one('mm'):.3g}" for x in (
                m.error_rms, m.error_peak, m.dwell_error, m.vibration)), "yes" if m.unstable else "no")
            for m in measures
        ],
    )  # fmt: skip
    for r, m in zip(order, measures, strict=True):
        kind = "collocated" if m.feedback == "x1" else "non-collocated"
        state = "unstable" if m.unstable else "stable"
        section.figure(
            plot_recording(r),
            f"{r.name}: {kind} P-control, Kp = {units.text(m.gain, 'V/mm')}, {state}.{shaded(r)}",
        )
    return section


def _same_run(a: Recording, b: Recording) -> bool:
    gains = a.excitation.gain or 0.0, b.excitation.gain or 0.0
    return a.excitation.feedback == b.excitation.feedback and abs(gains[0] - gains[1]) < 0.01 * max(gains)


def step_responses(found: Findings) -> Section:
    """Show the square waves (2.5)."""
    from identification.plots import plot_recording  # noqa: PLC0415

    section = Section("Velocity step responses (2.5)", "steps")
    units = found.likely.drive.units
    squares = [r for r in found.recordings if r.excitation.kind == "square"]
    shown: dict[float, Recording] = {}
    for r in squares:
        shown.setdefault(round(r.excitation.amplitude, 2), r)
    if not shown:
        section.text("No square wave was recorded.")
    for amplitude, r in sorted(shown.items()):
        same = sum(round(q.excitation.amplitude, 2) == amplitude for q in squares)
        section.figure(
            plot_recording(r),
            f"{r.name}: square of ±{units.text(amplitude, 'V')}, {units.text(r.excitation.frequency, 'Hz')}"
            + (f" (one of {same} replicates)" if same > 1 else ""),
        )
    return section


def sines(found: Findings) -> Section:
    """Show a few sines (2.6)."""
    from identification.plots import caption_of_sines, plot_sines  # noqa: PLC0415

    section = Section("Sine responses (2.6)", "sines")
    sines = [r for r in found.recordings if r.excitation.kind == "sine"]
    if not sines:
        section.text("No sine was recorded.")
        return section
    fn = found.likely.drive.linear.omega_n / (2.0 * pi) if found.likely.drive.carts == 2 else None
    section.figure(plot_sines(sines, natural_frequency=fn), caption_of_sines(sines, natural_frequency=fn))
    return section


def _quantity_rows(found: Findings) -> list[tuple[str, ...]]:
    symbols = {
        "omega_d": "ωd",
        "omega_n": "ωn",
        "zeta": "ζ",
        "alpha": "α = m2/m1",
        "beta": "β = b2/b1",
        "gamma": "γ = d2/d1",
    }
    handout = found.handout.quantities if isinstance(found.handout, Identification) else {}
    units, rows = found.likely.drive.units, list[tuple[str, ...]]()

    def cell(q: Quantity | None) -> str:
        return "–" if q is None else f"{q.of_rig(units).value:.4g}"

    for name, q in {**found.fit.quantities, **found.fit.ratios, **found.likely.effects}.items():
        told = (
            cell(handout.get(name))
            if name in handout
            else f"{HANDOUT_RATIOS[name]:g}"
            if name in HANDOUT_RATIOS
            else "–"
        )
        tied = {**found.tied.quantities, **found.tied.ratios}.get(name) if found.tied is not None else None
        own = q.of_rig(units)
        bounds = f"{own.ci95[0]:.4g} … {own.ci95[1]:.4g}" if own.ci95 is not None else "assumed"
        rows.append((symbols.get(name, name), own.unit, told, cell(tied), cell(q), bounds))
    return rows


def values(found: Findings) -> Section:
    """Show the quantities of 3.5 by every method."""
    section = Section("Identified values", "values")
    section.table(
        ("quantity", "unit", "handout 3.2", "ML, handout's ratios", "ML, free", "95 % interval (free)"),
        _quantity_rows(found),
    )
    section.text(
        "ML: maximum likelihood from all open-loop recordings, with α, β, γ held at the handout's values or estimated too."
    )
    return section


def identification(found: Findings) -> Section:
    """Show how each quantity was found (3.2)."""
    from identification import plots  # noqa: PLC0415

    section, units = Section("Identification (3.2)", "identification"), found.likely.drive.units
    if isinstance(found.handout, str):
        section.text(f"The handout's method cannot be applied: {found.handout}")
    else:
        result = found.handout.result
        assert isinstance(result, HandoutResult)
        section.heading("Handout: how the values were read off")
        section.figure(
            plots.plot_steady_state(result),
            "Steady velocity per amplitude, and Eq. (5) through them: slope 1/bT, intercept dT.",
        )
        section.figure(
            plots.plot_time_constant(result),
            "Time to 63 % of the output range on v1, and its bias under Coulomb friction.",
        )
        section.figure(plots.plot_damped_frequency(result), "Damped natural frequency from successive extrema of v2.")
        section.figure(plots.plot_zeta_iteration(result), "Steps 1–6: iteration of ζ.")
        section.items([*(f"{name}: {q.how}" for name, q in result.quantities.items()), *result.notes])
    fit = found.fit
    section.heading("Maximum likelihood: all open-loop recordings jointly")
    section.text(
        f"Output error on v1 and v2 with exact stick–slip friction: rms {units.text(fit.rms, 'mm/s', 3)} over {fit.samples} "
        "samples. "
        f"Successive residuals are correlated, so these tell as much as {fit.effective_samples:.0f} independent ones; the "
        "intervals take account of it."
    )
    # the last search alone saw all recordings, so its likelihood cannot be compared with the others'
    begun = {name: cost for name, cost in fit.starts.items() if not name.endswith(", refined")}
    best = min(begun, key=lambda name: begun[name])
    section.text(
        f"The likelihood may have several minima. {len(begun)} searches therefore began from as many starting points, on a part "
        f"of the recordings; the best of them, from “{best}”, was continued on all recordings and gives the values above."
    )
    section.items(list(fit.notes))
    return section


def time_domain(found: Findings) -> Section:
    """Overlay simulation and recording (3.3)."""
    from identification.plots import plot_validation  # noqa: PLC0415

    section, units = Section("Validation in time (3.3)", "time"), found.likely.drive.units
    if found.handout_validation is not None:
        section.heading("The handout's values")
        for overlay in _one_per_amplitude(found.handout_validation):
            section.figure(plot_validation(overlay.measured, overlay.simulated), _overlay_caption(overlay))
        section.text(
            f"Over all velocities the handout's values leave {units.text(found.handout_validation.rms, 'mm/s', 3)} "
            "rms; the maximum "
            f"likelihood fit leaves {units.text(found.validation.rms, 'mm/s', 3)}. If the time constant looks wrong, "
            "“flexdrive identify --method handout --p VALUE” recomputes everything for another real pole."
        )
        section.heading("Maximum likelihood")
    for overlay in _one_per_amplitude(found.validation):
        section.figure(plot_validation(overlay.measured, overlay.simulated), _overlay_caption(overlay))
    section.items(discussion.time_domain_observations(found.validation, found.likely.drive))
    rows = (f.of_rig(units) for f in found.validation.fits())
    fits = sorted(rows, key=lambda f: (words.by_number(f.recording), f.channel))
    section.table(
        ("recording", "channel", "rms", "floor", "unit", "NRMSE fit", "VAF", "autocorrelated", "input correlation"),
        [
            (f.recording, f.channel, _cell(f.rms), _cell(f.floor), f.unit, _cell(f.nrmse, "%"), _cell(f.vaf, "%"),
             _cell(f.correlated, "%"), _cell(f.input_correlation))
            for f in fits
        ],
        folded=f"Fit of every recording: {len(fits)} rows",
    )  # fmt: skip
    section.text(
        "In the table, autocorrelated is the share of lags at which the residual's autocorrelation leaves the 99 % band of white "
        "noise. An input correlation above 1 says that the command's past still explains part of the residual."
    )
    p_runs = [o for o in found.validation.overlays if o.how == "in the loop" and o.fits]
    if p_runs:
        section.heading("P-control predicted in the loop")
        for overlay in p_runs:
            section.figure(
                plot_validation(overlay.measured, overlay.simulated),
                f"{overlay.measured.name}: the identified drive in the same loop; no fit to this recording.",
            )
    windows = [o for o in found.validation.overlays if o.how.startswith("windows") and o.fits]
    if windows:
        section.heading("Closed loops of an unknown controller")
        for overlay in windows:
            section.figure(
                plot_validation(overlay.measured, overlay.simulated),
                f"{overlay.measured.name}: the identified drive under the recorded command, over {overlay.how}, each begun in "
                "the measured state.",
            )
    return section


def _one_per_amplitude(validation: Validation) -> list[Overlay]:
    """Return the overlay of the first square wave of every amplitude, small first."""
    shown: dict[float, Overlay] = {}
    for overlay in validation.overlays:
        if overlay.measured.excitation.kind == "square":
            shown.setdefault(round(overlay.measured.excitation.amplitude, 2), overlay)
    return [shown[amplitude] for amplitude in sorted(shown)]


def _overlay_caption(overlay: Overlay) -> str:
    units = overlay.measured.units
    fits = "; ".join(f"{f.channel} rms {units.text(f.rms, f.unit, 3)}, VAF {f.vaf:.1%}" for f in overlay.fits)
    return f"{overlay.measured.name}: measured and simulated. {fits}."


def _cell(value: float, kind: str = "") -> str:
    if value != value:  # noqa: PLR0124  (nan)
        return "–"
    return f"{value:.0%}" if kind == "%" else f"{value:.3g}"


def frequency_domain(found: Findings) -> Section:
    """Show the measured frequency response (3.4)."""
    from identification.plots import plot_bode  # noqa: PLC0415

    section, units = Section("Validation in frequency (3.4)", "frequency"), found.likely.drive.units
    if found.table is None:
        section.text("No sine was recorded.")
        return section
    section.table(*found.table.as_table())
    if isinstance(found.handout, Identification):
        section.heading("The handout's values")
        for cart, figure in enumerate(plot_bode(found.handout.drive.linear, found.table), start=1):
            section.figure(figure, f"s·G{cart} of Eq. (7) with the values of 3.2, and measured points.")
        section.heading("Maximum likelihood")
    drive = found.likely.drive
    amplitude = found.table.amplitude
    if drive.carts == 1:
        section.text("The handout's Bode plots are about two carts.")
        return section
    for cart, figure in enumerate(plot_bode(drive.linear, found.table, drive, amplitude), start=1):
        section.figure(
            figure,
            f"s·G{cart}: linear model (solid), with Coulomb friction's describing function at "
            f"±{units.text(amplitude, 'V')} (dashed), and "
            "measured points.",
        )
        section.items(discussion.frequency_domain_observations(found.table, drive, cart))
    return section


def stability(found: Findings) -> Section:
    """Show poles, zeros and the stability limit."""
    from identification.plots import plot_pole_zero  # noqa: PLC0415

    section = Section("Poles, zeros and the stability limit", "stability")
    drive = found.task
    if drive.carts == 2:
        section.figure(
            plot_pole_zero(drive.linear),
            "Pole-zero maps (Figure 3): (a) collocated G1, (b) non-collocated G2, identified drive.",
        )

    units, one = drive.units, drive.units.one("V/mm")

    def cell(value: float | None) -> str:
        return f"none below {10.0 / one:.3g}" if value is None else f"{value / one:.4g}"

    section.table(
        (
            "feedback", units.name("critical gain, Routh [V/mm]"), units.name("simulated with friction [V/mm]"),
            f"phase margin at {units.text(STABLE_GAIN, 'V/mm')} [deg]",
        ),
        [
            (name, cell(v.critical_gain_linear), cell(v.critical_gain_simulated),
             "–" if v.phase_margin_deg is None else f"{v.phase_margin_deg:.1f}")
            for name, v in found.limits.items()
        ],
    )  # fmt: skip
    if "x2" in found.limits:
        section.text(explain(drive, found.limits["x2"]) + measured_limit(found.observed, drive.units))
    return section

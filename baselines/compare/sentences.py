"""What a comparison found, in sentences made from its figures."""

from __future__ import annotations

from math import isfinite

from baselines.compare.results import Comparison


def headline(comparison: Comparison) -> list[str]:
    """Say in sentences what the comparison found, in the rig's units."""
    units = comparison.drive.units
    tolerance = units.text(comparison.tolerance, "mm")
    ranked = sorted(comparison.results, key=lambda r: (not r.nominal.success, r.nominal.rms))
    best = ranked[0]
    said = []
    if best.nominal.success:
        said.append(
            f"Least tracking error among those that settle within {tolerance} in every dwell: {best.entry.name}, "
            f"{units.text(best.nominal.rms, 'mm', 3)} rms, {units.text(best.nominal.peak, 'mm', 3)} peak."
        )
        failed = sum(not r.nominal.success for r in ranked)
        if failed:
            said.append(f"{failed} of {len(ranked)} do not settle in every dwell on the identified drive.")
    else:
        said.append(f"No controller settles within {tolerance} in every dwell.")
    # alike on every draw: then the draws say nothing of who is more robust
    drawn = [r for r in ranked if r.draws is not None and r.nominal.success]
    fragile = [r for r in drawn if r.draws is not None and r.draws.value < 1.0]
    if drawn and not fragile:
        said.append("Every controller that settles on the identified drive settles on all drawn drives.")
    elif fragile:
        least = min(fragile, key=lambda r: r.draws.value if r.draws is not None else 1.0)
        assert least.draws is not None
        said.append(
            f"{len(drawn) - len(fragile)} of the {len(drawn)} that settle do so on every drawn drive; {least.entry.name} "
            f"on {least.draws.value:.1%} of them."
        )
    lost = {r.entry.name: sum(not m.stable for m in r.effects.values()) for r in ranked}
    worst = max(lost, key=lambda name: lost[name])
    if lost[worst]:
        said.append(
            f"{sum(n > 0 for n in lost.values())} become unstable with some left-out effect, {worst} with {lost[worst]} of "
            f"{len(best.effects)}."
        )
    off = {
        r.entry.name: max(
            abs(e.gain_margin / m.gain_margin - 1.0), abs(e.delay_margin / m.delay_margin - 1.0)
        )
        for r in comparison.results
        for m, e in [(r.margins, r.empirical)]
        if m is not None and e is not None and isfinite(m.gain_margin) and isfinite(m.delay_margin)
        and isfinite(e.gain_margin) and isfinite(e.delay_margin)
    }  # fmt: skip
    if off:
        far = max(off, key=lambda name: off[name])
        alike = off[far] <= _ALIKE
        said.append(
            f"Margins found by trial agree with python-control's to {off[far]:.1%}."
            if alike
            else f"Margins found by trial are up to {off[far]:.0%} off python-control's ({far})."
        )
    return said


# of margins found by trial and by theory
_ALIKE = 0.05

"""Lab 3 in Python: from recordings to parameters, a Bode plot and the gain at which the loop becomes unstable."""

import marimo

app = marimo.App(width="medium", app_title="Lab 3 in Python")

with app.setup:
    import marimo as mo

    from baselines.lab.sample import FOLDER
    from baselines.loop_analysis.stability_limit import observed_limit, stability_limit
    from identification import identify, read_recordings, validate
    from identification.frequency_response import measure_frequency_response
    from identification.plots.bode import plot_bode
    from identification.plots.steps import plot_damped_frequency, plot_steady_state


@app.cell(hide_code=True)
def _():
    mo.md(r"""
    # Lab 3 in Python

    The result first: two carts joined by a spring are identified from twenty-two recordings, once by the handout's readings
    (3.2) and once by maximum likelihood. Both give a linear critical gain of P-control from cart 2. The rig holds a larger gain,
    because Coulomb friction damps small vibrations.

    `FOLDER` is the bundled sample. Put the path of your own folder in its place.
    """)
    return


@app.cell
def _():
    recordings = read_recordings(FOLDER)
    print(f"{len(recordings)} recordings, the first is {recordings[0].name}")
    return (recordings,)


@app.cell(hide_code=True)
def _():
    mo.md(r"""
    ## 3.2 by the handout

    Steady speed at two amplitudes gives $b_T$ and $d_T$, the 63 % time gives the pole $p$, the decaying vibration gives
    $\omega_d$ and $\zeta$. Ratios are the handout's: $\alpha = 0.54$, $\beta = \gamma = 0.1$.
    """)
    return


@app.cell
def _(recordings):
    handout = identify(recordings, "handout")
    print(handout)
    return (handout,)


@app.cell
def _(handout):
    plot_steady_state(handout.result)
    return


@app.cell
def _(handout):
    plot_damped_frequency(handout.result)
    return


@app.cell(hide_code=True)
def _():
    mo.md(r"""
    ## The same by maximum likelihood

    All open-loop recordings are replayed and fitted together, and no ratio is assumed. Every parameter has a 95 % interval.
    """)
    return


@app.cell
def _(recordings):
    likelihood = identify(recordings)
    for _name in ("m1", "m2", "b1", "b2", "d1", "d2", "k"):
        _low, _high = likelihood.drive.intervals[_name]
        print(f"{_name} = {likelihood.drive[_name]:.3g}  [{_low:.3g}, {_high:.3g}]")
    return (likelihood,)


@app.cell
def _(handout, likelihood, recordings):
    for _title, _found in (("handout", handout), ("maximum likelihood", likelihood)):
        _check = validate(_found.drive, recordings)
        print(f"{_title}: rms error {_check.rms:.1f} mm/s; recordings repeat to {_check.floor:.1f} mm/s")
    return


@app.cell(hide_code=True)
def _():
    mo.md(r"""
    ## 3.4: frequency response

    Points are measured from the sine recordings. The dashed line adds Coulomb friction as a describing function: it explains why
    the points lie below the linear curve.
    """)
    return


@app.cell
def _(likelihood, recordings):
    table = measure_frequency_response([r for r in recordings if r.excitation.kind == "sine"])
    plot_bode(likelihood.drive.linear, table, likelihood.drive)[1]  # cart 2
    return


@app.cell(hide_code=True)
def _():
    mo.md(r"""
    ## 2.2: the critical gain

    *Linear* is Routh's limit. *Simulated* is the drive with friction, encoder counts and ±8 V. The last line is what the
    recordings themselves show.
    """)
    return


@app.cell
def _(handout, likelihood, recordings):
    for _title, _found in (("handout", handout), ("maximum likelihood", likelihood)):
        _limit = stability_limit(_found.drive, "x2")
        print(
            f"{_title}: {_limit.critical_gain_linear:.3f} V/mm linear, {_limit.critical_gain_simulated:.3f} simulated"
        )
    observed = observed_limit(recordings)
    print(f"recordings: {observed.holds:.4f} V/mm holds, {observed.grows:.4f} grows")
    return


if __name__ == "__main__":
    app.run()

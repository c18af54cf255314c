"""Your own controller in the comparison: a linear one as data, any other as code, beside the handout's designs."""

import marimo

app = marimo.App(width="medium", app_title="Your own controller in the comparison")

with app.setup:
    import marimo as mo

    from baselines.compare import compare, entries
    from baselines.lab.sample import FOLDER
    from baselines.loop_analysis.margins import margins
    from flexdrive_gym import LinearController
    from identification import identify


@app.cell(hide_code=True)
def _():
    mo.md(r"""
    # Your own controller in the comparison

    The result first: anything that is called with an observation and returns a command in volts can be compared with the
    shipped designs. All controllers meet the same drives, so errors are compared in pairs. The drive is identified from the
    bundled sample; put your own folder in its place.

    ## A linear controller

    A lead around cart 1, $u = C(s)\,(x_r - x_1)$ with $C(s) = (0.02 s + 0.2)/(0.005 s + 1)$ in V/mm.
    It has margins, and it runs in the compiled loop.
    """)
    return


@app.cell
def _():
    drive = identify(FOLDER).drive
    return (drive,)


@app.cell
def _(drive):
    lead = LinearController.from_tf([0.02, 0.2], [0.005, 1.0], reads="x1", limit=8.0, name="lead")
    found = margins(drive, lead)
    print(f"gain margin {found.gain_margin:.1f}, phase margin {found.phase_margin_deg:.0f} degrees (linear)")
    return (lead,)


@app.cell(hide_code=True)
def _():
    mo.md(r"""
    ## Any other controller

    A class with state. It is called once a millisecond with an observation: `xr`, `x1`, `x2` in mm, `v1`, `v2` in mm/s, `t` in s.
    """)
    return


@app.cell
def _():
    class Careful:
        """P-control from x2 whose command changes by no more than 100 V/s."""

        reads = "x2"

        def __init__(self):
            self.reset()

        def reset(self):
            self.u = 0.0

        def __call__(self, seen):
            asked = 0.1 * (seen.xr - seen.x2)
            self.u += max(-0.1, min(0.1, asked - self.u))
            return self.u

    return (Careful,)


@app.cell(hide_code=True)
def _():
    mo.md(r"""
    ## Comparison

    `p_x2` and `lab4` are shipped designs, made anew for this drive. `draws=20` adds twenty drives drawn around it;
    `flexdrive compare` on the command line takes 500 and writes a page.
    """)
    return


@app.cell
def _(Careful, drive, lead):
    shipped = {entry.name: entry for entry in entries(drive, ("p_x2", "lab4"))[0]}
    comparison = compare(
        drive,
        {"lead": lead, "careful": Careful(), **shipped},
        draws=20,
        effects=False,
        references=(),
        empirical=False,
        backend="sequential",
    )
    print(comparison)
    return


if __name__ == "__main__":
    app.run()

"""Your own rig: files with foreign columns and units, a rig.toml that says what they mean, and what they can identify."""

import marimo

app = marimo.App(width="medium", app_title="Your own rig")

with app.setup:
    import tempfile
    from pathlib import Path

    import marimo as mo
    import numpy as np

    from flexdrive_gym import DEFAULT_DRIVE
    from flexdrive_gym.references import sine, square
    from identification import check, identify, read_recordings


@app.cell(hide_code=True)
def _():
    mo.md(r"""
    # Your own rig

    The result first: a folder of text files with foreign column names, milliseconds, encoder counts and a torque in N m is read
    by way of a `rig.toml` of a dozen lines; every figure is then in rad and N m.

    ## Files as another rig writes them

    Here a turning two-mass drive is simulated, so that the true parameters are known: 1 rad is 50 mm of the laboratory's rig, and
    1 N m is 2 V. Its encoders give 20,000 counts a turn. For a real rig, leave this cell out and take your own folder.
    """)
    return


@app.cell
def _():
    folder = Path(tempfile.mkdtemp())
    radian, newton_metre = 50.0, 2.0  # mm, V
    count = 2.0 * np.pi / 20_000.0  # rad
    t = np.arange(8001) * 1e-3
    commands = {
        "steps low": square(t, 1.5, 0.5),
        "steps high": square(t, 2.0, 0.5),
        "sine 1 Hz": sine(t, 2.5, 1.0),
        "sine 3 Hz": sine(t, 2.5, 3.0),
    }
    for _name, _u in commands.items():
        _run = DEFAULT_DRIVE.simulate(t, _u)
        _rows = np.column_stack(
            [1e3 * t, _u / newton_metre, *(np.round(x / radian / count) for x in (_run.x1, _run.x2))]
        )
        np.savetxt(
            folder / f"{_name}.txt", _rows, delimiter=";", header="millis;torque;motor;load", comments="", fmt="%.6g"
        )
    print((folder / "steps low.txt").read_text()[:80])
    return count, folder, newton_metre, radian


@app.cell(hide_code=True)
def _():
    mo.md(r"""
    ## What the columns mean

    `[columns]` gives each role the files' own name, `[units]` the unit and what one file unit is in it.
    """)
    return


@app.cell
def _(count, folder):
    rig = folder / "rig.toml"
    rig.write_text(f"""
    [rig]
    name = "turning drive"
    [columns]
    t = "millis"
    u = "torque"
    x1 = "motor"
    x2 = "load"
    [units]
    t = {{ unit = "s", factor = 0.001 }}
    u = "N m"
    x1 = {{ unit = "rad", factor = {count!r} }}
    x2 = {{ unit = "rad", factor = {count!r} }}
    """)
    recordings = read_recordings(folder, rig=rig)
    print(f"{len(recordings)} recordings, {len(recordings.skipped)} files left out")
    return (recordings,)


@app.cell(hide_code=True)
def _():
    mo.md(r"""
    ## What they can identify

    `check` says what was understood, which parameters these experiments determine, and which experiment mends a lack.
    """)
    return


@app.cell
def _(recordings):
    print(check(recordings))
    return


@app.cell(hide_code=True)
def _():
    mo.md(r"""
    ## Parameters in the rig's own units, beside the true ones
    """)
    return


@app.cell
def _(newton_metre, radian, recordings):
    drive = identify(recordings).drive
    # what one N m over one rad is in V/mm
    stiffness = newton_metre / radian
    for _name, _unit, _lab, _one in (
        ("m1", "V s²/mm", "N m s²/rad", stiffness),
        ("b1", "V s/mm", "N m s/rad", stiffness),
        ("k", "V/mm", "N m/rad", stiffness),
        ("d1", "V", "N m", newton_metre),
    ):
        _low, _high = (drive.units.of_rig(x, _unit)[0] for x in drive.intervals[_name])
        print(f"{_name} between {_low:.5g} and {_high:.5g} {_lab}, true {DEFAULT_DRIVE[_name] / _one:.5g}")
    return


if __name__ == "__main__":
    app.run()

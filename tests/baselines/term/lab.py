"""Short hand-ins of simulated rigs, as groups leave them."""

import zipfile
from dataclasses import replace

from flexdrive_gym import Drive
from identification import write_recording
from tests.drive.drives import RIG
from tests.identification.lab import COUNTS, QUANTUM, T, run

KINDS = (("square", 2.0, 0.5), ("sine", 2.5, 0.5), ("sine", 2.5, 3.0))


def short_runs(seed, **changes):
    """Three short runs of a rig."""
    rig = Drive({**RIG, **COUNTS, **changes})
    return [
        replace(run(rig, *kind, t=T, force=0.05, seed=seed + i), quantum=(QUANTUM, QUANTUM))
        for i, kind in enumerate(KINDS)
    ]


def hand_in(folder, runs, *, prefix=""):
    for r in runs:
        write_recording(r, folder / f"{prefix}{r.name}.csv")
    return folder


def packed(folder):
    """Replace a folder by an archive."""
    with zipfile.ZipFile(folder.with_suffix(".zip"), "w", zipfile.ZIP_DEFLATED) as made:
        for file in sorted(folder.rglob("*.csv")):
            made.write(file, file.relative_to(folder.parent))
            file.unlink()
    folder.rmdir()
    return folder.with_suffix(".zip")


def term(folder):
    """Two sound groups, one with encoder 2 the wrong way round, one with another's recordings, one broken archive."""
    hand_in(folder / "group 1" / "lab" / "day", short_runs(10))
    packed(hand_in(folder / "group 2", short_runs(20)))
    hand_in(folder / "group 3", [replace(r, v2=-r.v2) for r in short_runs(30)])
    hand_in(folder / "group 4", short_runs(10)[:2], prefix="ours_")
    (folder / "group 5.zip").write_bytes(b"PK\x03\x04 and no more")
    return folder

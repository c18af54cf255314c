"""Damaged recordings of every kind, seeded: whatever is read, nothing but the package's own error may come of it.

``python -m tests.identification.recordings.fuzz --runs 10000`` damages as many files and prints what came of them. Memory is
bounded, so that a header that declares gigabytes shows as an error of this script.
"""

import argparse
import gzip
import io
import re
import resource
import sys
import tempfile
import time
import warnings
from collections import Counter
from functools import cache
from pathlib import Path

import h5py
import numpy as np
import scipy.io

from identification.recordings import RecordingError, read_recordings
from tests.identification.recordings.logs import csv_text, velocity_log

MEMORY = 3 << 30  # bytes of address space
MESSAGE = re.compile(r".+?: .+?: .+; got .*\. .+", re.DOTALL)
NUMBERS = (
    b"1e999",
    b"-1e308",
    b"nan",
    b"inf",
    b"",
    b"9" * 400,
    b"0x10",
    b"1,5",
    b"1e-320",
    b"-",
    b"1d3",
    b"''",
    b"\xff",
)
WORDS = (0, 1, 5, 14, 15, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 1 << 20, 1 << 28, 0x00010001)
RIG = """
[rig]
name = "bench"
carts = 2
known = ["ground_spring"]
sample_time = 0.001
[columns]
t = "1"
u = ["2", "dac"]
v1 = "3"
v2 = "3 + 4"
[units]
u = { unit = "V", factor = -1.0 }
v1 = { unit = "mm/s", factor = 1.0 }
[scale]
length = 1.0
[[files]]
match = "b*"
use = false
held = [2]
session = "monday"
"""


def _log():
    return velocity_log("sine", 2.5, 5.0, 0.3)


def _matlab(**options):
    log = _log()
    t, u, v1, v2 = log.values()
    signals = np.empty(2, dtype=[("values", object), ("label", object)])
    signals[0], signals[1] = (v1, "v1"), (v2, "v2")
    extra = (
        {}
        if options.get("format") == "4"
        else {"S": {"time": t, "signals": signals}, "names": np.array(["a", 1], object)}
    )
    file = io.BytesIO()
    scipy.io.savemat(file, {"t": t, "u": u, "v1exp": np.column_stack([t, v1]), "A": np.eye(4), **extra}, **options)
    return file.getvalue()


def _hdf5(**options):
    log = _log()
    file = io.BytesIO()
    with h5py.File(file, "w") as made:
        for name, values in zip(("t", "u", "v1", "v2"), log.values(), strict=True):
            made.create_dataset(name, data=values[None], **options).attrs["MATLAB_class"] = np.bytes_("double")
        group = made.create_group("S")
        group.create_dataset("time", data=log["t_s"][None])
        refs = made.create_group("#refs#")
        cell = group.create_dataset("names", (1, 2), dtype=h5py.ref_dtype)
        for k, word in enumerate(("u", "v1")):
            text = refs.create_dataset(word, data=np.array([[ord(letter)] for letter in word], np.uint16))
            text.attrs["MATLAB_class"] = np.bytes_("char")
            cell[0, k] = text.ref
    return file.getvalue()


@cache
def sound_files():
    """Return files that can be read, by the name that each kind has."""
    log = _log()
    rows = np.column_stack(list(log.values()))
    comma = csv_text(log)
    bare = "\n".join(" ".join(f"{cell:.6g}" for cell in row) for row in rows)
    return {
        "a.csv": comma.encode(),
        "b.csv": ("t,u,v1\ns,V,mm/s\n" + "\n".join(f"{a:.3f},{b:.6g},{c:.6g}" for a, b, c, _ in rows)).encode(),
        "c.txt": csv_text(log, ";").replace(".", ",").encode(),
        "d.dat": ("# rig 3\n" + csv_text(log, "\t")).encode(),
        "e.asc": bare.encode(),
        "f.log": ("data = [" + bare.replace("\n", ";\n") + "];").encode(),
        "g.csv.gz": gzip.compress(comma.encode(), mtime=0),
        "h.tsv": b"".join(
            [
                b"time\tu\tv1\n",
                *(b"2025-11-20T11:21:24.%03d\t%.4f\t%.4f\n" % (k, r[1], r[2]) for k, r in enumerate(rows)),
            ]
        ),
        "i.mat": _matlab(format="4"),
        "j.mat": _matlab(),
        "k.mat": _matlab(do_compression=True),
        "l.mat": _hdf5(),
        "m.mat": _hdf5(compression="gzip", chunks=(1, 64)),
        "rig.toml": RIG.encode(),
    }


def damaged(data, rng):
    """Return a file with one kind of damage, or with two or three."""
    made = bytearray(data)
    for _ in range(int(rng.choice([1, 1, 1, 2, 3]))):
        size = max(len(made), 1)
        kind = int(rng.integers(9))
        # headers decide most, so half of the damage is done near the beginning
        place = int(rng.integers(min(size, 600)) if rng.random() < 0.5 else rng.integers(size))
        span = int(min(rng.geometric(0.02), size - place))
        if kind == 0:
            del made[place:]
        elif kind == 1:
            for where in rng.integers(0, size, int(rng.integers(1, 20))):
                made[where : where + 1] = bytes([int(rng.integers(256))])
        elif kind == 2:
            made[place:place] = rng.bytes(int(rng.integers(1, 40)))
        elif kind == 3:
            del made[place : place + span]
        elif kind == 4:
            made[place:place] = made[place : place + span] * int(rng.integers(1, 6))
        elif kind == 5:
            found = list(re.finditer(rb"[-+.\w]+", bytes(made[place : place + 400])))
            if found:
                token = found[int(rng.integers(len(found)))]
                made[place + token.start() : place + token.end()] = NUMBERS[int(rng.integers(len(NUMBERS)))]
        elif kind == 6:
            start = place // 4 * 4
            made[start : start + 4] = WORDS[int(rng.integers(len(WORDS)))].to_bytes(4, "little")
        elif kind == 7:
            lines = bytes(made).split(b"\n")
            rng.shuffle(lines)
            made = bytearray(b"\n".join(lines))
        else:
            made = made.replace(
                *[(b",", b";"), (b"\n", b"\r"), (b".", b","), (b"0", b"e"), (b" ", b""), (b"=", b"[")][
                    int(rng.integers(6))
                ]
            )
    return bytes(made)


def run(seed, folder):
    """Damage one file, read it, and return what kind it is and what came of it.

    Raises
    ------
    AssertionError
        If reading ends in anything but recordings or the package's error in its usual form.
    """
    rng = np.random.default_rng(seed)
    files = sound_files()
    name = list(files)[int(rng.integers(len(files)))]
    path = Path(folder) / name
    if name.endswith(".gz") and rng.random() < 0.5:
        path.write_bytes(gzip.compress(damaged(gzip.decompress(files[name]), rng), mtime=0))
    else:
        path.write_bytes(damaged(files[name], rng))
    source, rig = path, None
    if name == "rig.toml":
        source = Path(folder) / "sound.txt"
        source.write_bytes(files["e.asc"])
        rig = path
    elif rng.random() < (0.9 if name in ("e.asc", "f.log") else 0.2):
        rig = Path(folder) / "sound.toml"
        rig.write_bytes(files["rig.toml"])
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            found = read_recordings(source, rig=rig)
    except RecordingError as error:
        text = str(error)
        if not MESSAGE.match(text) and "left out by rig.toml" not in text:
            raise AssertionError(f"seed {seed}, {name}: a message without rule, value and remedy: {text}") from error
        if len(text) > 1200:
            raise AssertionError(f"seed {seed}, {name}: a message of {len(text)} letters: {text[:200]}") from error
        return name, "refused"
    except Exception as error:
        raise AssertionError(f"seed {seed}, {name}: {type(error).__name__}: {str(error)[:300]}") from error
    (recording,) = found
    signals = [recording.t, recording.u, *(values for _, values in recording.channels())]
    if not all(np.isfinite(values).all() and values.size == recording.n for values in signals):
        raise AssertionError(f"seed {seed}, {name}: read with values that are no numbers")
    return name, "warned of" if any(note.startswith("warning:") for note in recording.notes) else "read"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0, help="first seed")
    arguments = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    started, counts, wrong = time.perf_counter(), Counter(), []
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(arguments.seed, arguments.seed + arguments.runs):
            try:
                counts[run(seed, folder)] += 1
            except AssertionError as error:
                wrong.append(str(error))
                sys.stdout.write(f"{error}\n")
                sys.stdout.flush()
    for name in sound_files():
        parts = ", ".join(f"{counts[name, kind]} {kind}" for kind in ("refused", "warned of", "read"))
        sys.stdout.write(f"{name:10s} {parts}\n")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss >> 10
    seconds = time.perf_counter() - started
    sys.stdout.write(f"{arguments.runs} damaged files in {seconds:.0f} s, at most {peak} MB; {len(wrong)} wrong\n")
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main())

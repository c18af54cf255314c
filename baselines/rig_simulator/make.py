"""``python -m baselines.rig_simulator.make``: make one concealed data set and seal its truth."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from baselines.rig_simulator.recordings import data_set, put, write_data_set
from baselines.rig_simulator.truth import KINDS, draw_truth, seal


def make_case(
    folder: Path,
    truth_file: Path,
    seed: int,
    kind: str | None = None,
    size: float | None = None,
    effect: tuple[str, str] | None = None,
) -> str:
    """Write the recordings of one case to a folder and its truth elsewhere.

    Returns
    -------
    str
        SHA-256 of the truth file.

    Raises
    ------
    ValueError
        If the truth would lie among the recordings.
    """
    if folder.resolve() in (truth_file.resolve(), *truth_file.resolve().parents):
        raise ValueError(
            f"truth: must lie outside the folder of the recordings, {folder}; got {truth_file}. Give another path."
        )
    known = next((k for k in KINDS if k == kind), None)
    truth, logs = data_set(draw_truth(seed, known, size=size, effect=effect))
    text = truth.json()
    # the seal is on disk before there is anything to diagnose
    put(truth_file, text.encode())
    digest = seal(text)
    put(truth_file.with_name(truth_file.name + ".sha256"), f"{digest}  {truth_file.name}\n".encode())
    write_data_set(truth, logs, folder)
    return digest


def main(arguments: Sequence[str] | None = None) -> int:
    """Read the command line, make the case, print the seal."""
    parser = argparse.ArgumentParser(prog="python -m baselines.rig_simulator.make", description=__doc__)
    parser.add_argument("--seed", type=int, required=True, help="everything follows from it")
    parser.add_argument("--kind", choices=KINDS, help="drawn by the documented mixture if not given")
    parser.add_argument(
        "-o", "--output", type=Path, required=True, help="folder of the recordings, and of nothing else"
    )
    parser.add_argument("--truth", type=Path, required=True, help="file of the sealed truth, outside that folder")
    parser.add_argument("--size", type=float, help="size of the effects, 1 is plainly present")
    parser.add_argument("--effect", metavar="ID@WHERE", help="for development: conceal this one")
    given = parser.parse_args(arguments)
    effect = None
    if given.effect is not None:
        name, _, where = given.effect.partition("@")
        effect = (name, where)
    try:
        digest = make_case(given.output, given.truth, given.seed, given.kind, given.size, effect)
    except (ValueError, KeyError) as error:
        print(f"error: {error.args[0]}", file=sys.stderr)
        return 2
    print(f"{digest}  {given.truth}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())

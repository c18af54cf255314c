"""Whether effects are named that are a few times as large as the least size that a diagnosis says could be seen.

``python -m benchmarks detection [--draws 4] [--jobs 2]``: data sets of the independent rig simulator in which nothing is
concealed are diagnosed, which tells below which size no effect would be seen. Then one of the effects whose size means the same
in both programs is concealed in the same rig, at that size, at twice and at four times it; runs differ in nothing else. Every
rig has the next effect; four diagnoses each, a minute apiece. Results are kept in the cache directory, as those of
``false_alarms``.
"""

import argparse
import json
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import joblib
from platformdirs import user_cache_path

from baselines.blind_study.judge import SAME_SIZES
from baselines.blind_study.study import engine
from baselines.evaluation.proportions import share
from baselines.rig_simulator.recordings import data_set, write_data_set
from baselines.rig_simulator.truth import Effect, Truth, draw_truth
from flexdrive_gym.files import write_atomically
from identification import diagnose
from identification.mismatch.answer.verdict import Diagnosis

# concealed in turn, of those whose size means the same in both programs
ASKED = (
    ("encoder_delay", "encoder_2"),
    ("coupling_backlash", "spring"),
    ("input_offset", "actuator"),
    ("encoder_play", "encoder_1"),
    ("gain_asymmetry", "actuator"),
    ("amplifier_lag", "actuator"),
    ("dead_zone", "actuator"),
    ("load_friction", "cart_2"),
    ("input_delay", "actuator"),
    ("encoder_scale", "encoder_2"),
)
MULTIPLES = (1.0, 2.0, 4.0)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks detection", description=__doc__)
    parser.add_argument("--draws", type=int, default=4)
    parser.add_argument("--jobs", type=int, default=2)
    given = parser.parse_args(sys.argv[2:])
    if given.draws < 1:
        parser.error(f"argument --draws: must be at least 1; got {given.draws}. Ten ask every effect once.")
    folder = user_cache_path("flexdrive") / "detection" / engine()
    found = joblib.Parallel(n_jobs=given.jobs)(joblib.delayed(one)(d, folder / f"{d}.json") for d in range(given.draws))
    print("| rig | effect | not seen below | at | named |\n|---|---|---|---|---|")
    for draw, rows in enumerate(found):
        for r in rows:
            print(
                f"| {draw} | {r['name']} | {r['limit']:.3g} {r['unit']} | × {r['multiple']:g} | {r['named'] or '–'} |"
            )
    for multiple in MULTIPLES:
        at = [r["hit"] for rows in found for r in rows if r["multiple"] == multiple]
        if at:
            print(f"named or tied at {multiple:g} of the size: {share(at)}")


def one(draw: int, path: Path) -> list[dict[str, object]]:
    """Return what is named on one rig, for every multiple of an effect's least size."""
    if path.exists():
        return list(json.loads(path.read_text()))
    nothing = draw_truth(draw, "null")
    id_, where = ASKED[draw % len(ASKED)]
    name, (own, theirs) = f"{id_}@{where}", SAME_SIZES[id_]
    limit = next((x for x in _diagnosed(nothing, draw).detection_limits if x.name == name and x.parameter == own), None)
    rows: list[dict[str, object]] = []
    for multiple in MULTIPLES if limit is not None and limit.value < float("inf") else ():
        assert limit is not None
        effect = Effect(id_, where, {theirs.format(cart=where[-1]): multiple * limit.value}, multiple)
        found = _diagnosed(replace(nothing, effects=(effect,)), draw).findings
        hit = any(name in (f.name, *(f"{t.id}@{t.where}" for t in f.ties)) for f in found)
        named = ", ".join(f.name for f in found)
        rows.append(
            {"name": name, "limit": limit.value, "unit": limit.unit, "multiple": multiple, "named": named, "hit": hit}
        )
    write_atomically(path, json.dumps(rows))
    return rows


def _diagnosed(truth: Truth, seed: int) -> Diagnosis:
    with tempfile.TemporaryDirectory(prefix="flexdrive-") as folder:
        made, logs = data_set(truth)
        write_data_set(made, logs, Path(folder) / "recordings")
        return diagnose(Path(folder) / "recordings", seed=seed, jobs=1)


if __name__ == "__main__":
    main()

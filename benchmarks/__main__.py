"""``python -m benchmarks [NAME ...]``: run the quick ones, or those named; the long ones take options."""

import sys

from benchmarks import (
    accuracy,
    base_drives,
    blind_nuisance,
    controllers,
    coverage,
    detection,
    diagnosis,
    environment,
    export,
    false_alarms,
    friction_by_run,
    gymnasium_import,
    lab,
    last_digits,
    later_names,
    learners,
    learning,
    near_breakaway,
    overlay,
    paired,
    play,
    predictions,
    real_rigs,
    recordings,
    remaining_force,
    reversals,
    rounds,
    sim_to_real,
    speed,
    term,
)

ALL = {
    "accuracy": accuracy.main,
    "speed": speed.main,
    "environment": environment.main,
    "gymnasium_import": gymnasium_import.main,
    "learning": learning.main,
    "near_breakaway": near_breakaway.main,
    "real_rigs": real_rigs.main,
    "recordings": recordings.main,
    "coverage": coverage.main,
    "blind_nuisance": blind_nuisance.main,
    "controllers": controllers.main,
    "export": export.main,
    "overlay": overlay.main,
}
# these take minutes to hours, and options of their own
LONG = {
    "base_drives": base_drives.main,
    "detection": detection.main,
    "diagnosis": diagnosis.main,
    "lab": lab.main,
    "false_alarms": false_alarms.main,
    "friction_by_run": friction_by_run.main,
    "last_digits": last_digits.main,
    "later_names": later_names.main,
    "learners": learners.main,
    "paired": paired.main,
    "play": play.main,
    "predictions": predictions.main,
    "remaining_force": remaining_force.main,
    "reversals": reversals.main,
    "rounds": rounds.main,
    "sim_to_real": sim_to_real.main,
    "term": term.main,
}


def main() -> int:
    if sys.argv[1:2] and sys.argv[1] in LONG:
        try:
            LONG[sys.argv[1]]()
        except ValueError as error:
            print(f"benchmarks {sys.argv[1]}: {error}", file=sys.stderr)
            return 2
        return 0
    names = sys.argv[1:] or list(ALL)
    unknown = [name for name in names if name not in ALL]
    if unknown:
        print(f"benchmarks: no benchmark {', '.join(unknown)}; there are {', '.join([*ALL, *LONG])}", file=sys.stderr)
        return 2
    for name in names:
        print(f"== {name}")
        ALL[name]()
    return 0


if __name__ == "__main__":
    raise SystemExit(main())

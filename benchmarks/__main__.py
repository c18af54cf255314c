"""``python -m benchmarks [NAME ...]``: run all, or those named."""

import sys

from benchmarks import accuracy, blind_nuisance, controllers, coverage, environment, real_rigs, speed

ALL = {
    "accuracy": accuracy.main,
    "speed": speed.main,
    "environment": environment.main,
    "real_rigs": real_rigs.main,
    "coverage": coverage.main,
    "blind_nuisance": blind_nuisance.main,
    "controllers": controllers.main,
}


def main() -> int:
    names = sys.argv[1:] or list(ALL)
    unknown = [name for name in names if name not in ALL]
    if unknown:
        print(f"benchmarks: no benchmark {', '.join(unknown)}; there are {', '.join(ALL)}", file=sys.stderr)
        return 2
    for name in names:
        print(f"== {name}")
        ALL[name]()
    return 0


if __name__ == "__main__":
    raise SystemExit(main())

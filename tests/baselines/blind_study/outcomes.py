"""Outcomes made by hand, for tests of how they are judged."""

from flexdrive_gym import Drive
from flexdrive_gym.drive.toml import dumps

BASE = {"m1": 7.6e-4, "m2": 3.4e-4, "b1": 0.0096, "b2": 0.0032, "k": 0.095, "d1": 0.36, "d2": 0.24}
DRIVE = dumps(Drive(BASE, {n: (0.9 * v, 1.1 * v) for n, v in BASE.items()}))


def finding(id_, where, ties=(), parameters=None):
    return {
        "id": id_,
        "where": where,
        "ties": [{"id": i, "where": w} for i, w in ties],
        "parameters": {n: {"value": v, "ci95": list(ci)} for n, (v, ci) in (parameters or {}).items()},
    }


def effect(id_, where, size=1.0, **numbers):
    return {"id": id_, "where": where, "size": size, "parameters": numbers}


def outcome(kind, effects=(), findings=(), *, number=0, unnamed=False, faults=(), found_faults=(), failed=None):
    """An outcome as ``conduct`` writes it."""
    answer = {
        "diagnosis": {
            "findings": list(findings),
            "unnamed": {"where": "cart_1"} if unnamed else None,
            "faults": [{"id": "encoder_dropout", **f} for f in found_faults],
            "fit": {"before_rms": 6.0, "after_rms": 3.3, "floor_rms": 3.0},
        },
        "drives": {"diagnosed": DRIVE},
        "critical_gains": {"tied": 0.1, "free": 0.26, "diagnosed": 0.21},
    }
    return {
        "trial": {"number": number},
        "truth": {"kind": kind, "effects": list(effects), "faults": list(faults), "drive": {**BASE, "k": 0.2}},
        "answer": None if failed else answer,
        "failed": failed,
        "seconds": 30.0,
        "critical_gain": 0.2,
        "payoff": None,
    }

"""What a reader sees first: the best of each kind, P-control, a learnt policy, and the reader's own."""

from types import SimpleNamespace

from baselines.cli._tables import laid_out
from baselines.compare import Entry, shortlist
from baselines.compare.tables import overview_table
from baselines.controllers import FAMILIES, KINDS


def result(name, rms, *, success=True, learnt=False):
    entry = Entry(name, None, learnt=learnt, period=5e-3 if learnt or "@" in name else 1e-3)
    nominal = SimpleNamespace(rms=rms, peak=2.0 * rms, success=success, vibration=1e-3)
    margin = SimpleNamespace(gain_margin=2.125)
    return SimpleNamespace(
        entry=entry, nominal=nominal, margins=margin, on_rig=margin, draws=SimpleNamespace(value=0.987)
    )


def comparison(*results):
    drive = SimpleNamespace(name="rig", voltage_limit=8.0, units=SimpleNamespace(command="V"))
    return SimpleNamespace(results=results, limit=8.0, drive=drive)


def many():
    names = [*FAMILIES, *(f"{name}@5ms" for name in FAMILIES), "lab4+preview"]
    return [result(name, 1.0 + i) for i, name in enumerate(names)]


def test_few_are_all_shown():
    found = comparison(*many()[:5])
    assert shortlist(found) == found.results


def test_eight_of_many_one_of_each_kind_with_p_control_and_the_best_policy():
    best = result("x2-1", 30.0, learnt=True)
    found = comparison(*many(), result("x2-0", 0.1, success=False, learnt=True), best)
    chosen = shortlist(found)
    names = [r.entry.name for r in chosen]
    assert len(chosen) == 8
    assert best in chosen
    assert names[0] == "p_x2"
    assert len({KINDS[name] for name in names[:-1]}) == 7
    assert not any("@" in name or "+" in name for name in names)


def test_ones_own_come_first_and_what_does_not_settle_last():
    own = [result("mine", 50.0, success=False), result("my_pd", 40.0)]
    failed = [result(name, 0.01, success=False) for name in FAMILIES if KINDS[name] == "lqg"]
    others = [r for r in many() if KINDS.get(r.entry.name) != "lqg"]
    names = [r.entry.name for r in shortlist(comparison(*own, *others, *failed))]
    assert names[:2] == ["mine", "my_pd"]
    assert not any(KINDS.get(name) == "lqg" for name in names)


def test_the_eight_fit_a_terminal_of_80_columns():
    found = comparison(*many())
    table = overview_table(found.drive, found.limit, shortlist(found))
    (sheet,) = laid_out(table.columns, table.rows, 80)
    assert max(map(len, sheet)) <= 80
    assert all(len([line for line in sheet if line.startswith(row[0])]) == 1 for row in table.rows)

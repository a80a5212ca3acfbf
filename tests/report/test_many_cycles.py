"""Of many unseen cycles `compare` lists the worst and the median, not a wall of lines."""

from statistics import median

import pytest
from smallmachine import small_machine

from thermocomp.judging.compare import compare
from thermocomp.judging.splits import leave_one_cycle_out
from thermocomp.recordings.stacking import stack
from thermocomp.report.layout import Layout
from thermocomp.report.printed import comparison


def test_the_worst_cycles_and_the_median_of_all() -> None:
    samples = stack([small_machine([1000.0 + 60 * k for k in range(30)], dt=500.0)], ["z_um", "x_um"])
    found = compare(samples, ["ols", "ridge"], leave_one_cycle_out(samples), robustness=False)
    table = [item for item in comparison(found) if isinstance(item, Layout)][1]
    names = [str(row[0]).strip() for row in table.rows]
    assert names.count("median of all 30") == 2
    assert len(names) == 2 * (1 + 12 + 1)
    for target, at in (("z_um", 0), ("x_um", 14)):
        mine = [a for a in found.overall() if a.target == target]
        assert names[at] == target
        largest: dict[str, tuple[bool, float]] = {}
        for u in (u for a in mine for u in a.verdict.units):
            largest[u.name] = max(largest.get(u.name, (False, 0.0)), (u.harmful, u.rms))
        worst = sorted(largest, key=largest.__getitem__)[-12:]
        assert names[at + 1 : at + 13] == [name for name in largest if name in worst]
        told = [float(cell) for cell in table.rows[at + 13][1:]]
        expected = [median(u.none_rms for u in mine[0].verdict.units)]
        expected += [median(u.rms for u in a.verdict.units) for a in mine]
        assert told == pytest.approx(expected, abs=0.006)

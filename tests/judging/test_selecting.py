"""Every selector brought to one form: sensors that exist, tables that add up, and what the user should know."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from smallmachine import crowded_machine

from thermocomp.core.exceptions import FitError, InputError
from thermocomp.judging import selecting, splits
from thermocomp.judging.choice import Choice, Settings, Table, format_cell
from thermocomp.models.grouping import CorrelationGrouping
from thermocomp.models.selection import subsetsearch
from thermocomp.models.selection.subsets import best_subsets
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack

METHODS = ("correlation", "grouping", "partial-f", "stepwise", "subsets", "ace", "pareto")
TOGETHER = ("correlation", "ace", "pareto")
SETTINGS = Settings(max_sensors=3, models=["ols"])


@pytest.fixture(scope="module")
def crowd() -> Samples:
    return stack([crowded_machine()], ["x_um", "z_um"])


@pytest.fixture(scope="module")
def choices(crowd: Samples) -> dict[str, tuple[Choice, ...]]:
    judging = splits.leave_one_cycle_out(crowd)
    return {m: selecting.select(m, crowd, judging, SETTINGS) for m in METHODS}


@pytest.mark.parametrize("method", METHODS)
def test_every_method_chooses_temperatures_that_exist(choices: dict[str, tuple[Choice, ...]], method: str) -> None:
    found = choices[method]
    assert [c.target for c in found] == (["x_um, z_um"] if method in TOGETHER else ["x_um", "z_um"])
    for c in found:
        assert c.method == method
        assert set(c.sensors) <= {f"t{k}_C" for k in range(1, 7)}
        assert c.sensors
        assert "t1_C" in c.sensors or "t4_C" in c.sensors or "t2_C" in c.sensors  # what drives the drift
        assert c.reason
        assert c.notes
        for t in c.tables:
            assert t.rows
            assert all(len(row) == len(t.columns) for row in t.rows)
            assert t.marked is None or 0 <= t.marked < len(t.rows)


def table(choice: Choice, title: str) -> Table:
    return next(t for t in choice.tables if t.title.startswith(title))


def test_grouping_puts_the_repeating_sensors_together(choices: dict[str, tuple[Choice, ...]], crowd: Samples) -> None:
    choice = choices["grouping"][0]
    groups = [set(str(row[1]).split()) for row in table(choice, "Groups").rows]
    assert any({"t1_C", "t4_C"} <= g for g in groups)
    assert isinstance(choice.details, CorrelationGrouping)
    thresholds = table(choice, "Results with other")
    assert thresholds.marked is not None
    low, high, n_groups, sensors = thresholds.rows[thresholds.marked][:4]
    assert isinstance(low, float)
    assert isinstance(high, float)
    assert low <= 0.9 < high
    assert n_groups == len(groups)
    assert str(sensors).split() == list(choice.sensors)
    ends = [row[:2] for row in thresholds.rows]
    assert all(a[1] == b[0] for a, b in pairwise(ends))  # no gap between the rows


def test_screening_is_for_all_targets_together(choices: dict[str, tuple[Choice, ...]], crowd: Samples) -> None:
    """C-11: t4_C and t5_C repeat t1_C."""
    (choice,) = choices["correlation"]
    (shown,) = choice.tables
    assert shown.columns[:4] == ("kept", "sensor", "r x_um", "r z_um")
    assert [row[0] for row in shown.rows] == [1, 2, 3, None, None, None]
    assert tuple(str(row[1]) for row in shown.rows[:3]) == choice.sensors
    assert len({"t1_C", "t4_C", "t5_C"} & {*choice.sensors}) == 1
    r = np.corrcoef(crowd.change()[:, [c.name for c in crowd.inputs].index(choice.sensors[0])], crowd.deviations.T)
    assert shown.rows[0][2:4] == pytest.approx(tuple(r[0, 1:]))
    still = replace(crowd, deviations=crowd.deviations * [1.0, 0.0])
    (alone,) = selecting.select("correlation", still, splits.leave_one_cycle_out(crowd), SETTINGS)
    assert alone.notes[-1] == "z_um is constant: it was not considered."
    with pytest.raises(FitError, match="no temperature varies together with x_um or z_um"):
        selecting.select(
            "correlation", replace(crowd, deviations=0 * crowd.deviations), splits.leave_one_cycle_out(crowd), SETTINGS
        )


def test_a_reference_is_needed_too(crowd: Samples) -> None:
    settings = Settings(reference="t3_C")
    (choice, _) = selecting.select("grouping", crowd, splits.leave_one_cycle_out(crowd), settings)
    assert choice.sensors[-1] == "t3_C"
    with pytest.raises(InputError, match="no input is named 't33_C'"):
        selecting.select("grouping", crowd, splits.leave_one_cycle_out(crowd), Settings(reference="t33_C"))


def test_subsets_show_the_best_of_every_size(choices: dict[str, tuple[Choice, ...]], crowd: Samples) -> None:
    choice = choices["subsets"][0]
    shown = table(choice, "Best subset")
    X, y = crowd.change()[:, :6], crowd.deviations[:, 0]
    columns = [c.name for c in crowd.inputs if c.quantity == "temperature"]
    expected = best_subsets(
        crowd.change()[:, [j for j, c in enumerate(crowd.inputs) if c.name in columns]], y, max_size=3
    )
    assert [str(row[-1]).split() for row in shown.rows] == [[columns[j] for j in s.columns] for s in expected.best]
    assert all(row[-2] == "proven" for row in shown.rows)
    assert shown.caption.endswith("the others cannot be better.")
    assert shown.marked is not None
    assert str(shown.rows[shown.marked][-1]).split() == list(choice.sensors)
    assert X.shape[1] == 6


def test_too_few_cycles_for_the_wilcoxon_test_are_told(choices: dict[str, tuple[Choice, ...]]) -> None:
    (choice,) = choices["ace"]
    assert any("too few" in n for n in choice.notes)
    assert len(choice.sensors) <= 3
    counts = table(choice, "Best set").caption
    assert "41 sets, 4 thermal cycles, 2 displacements: 328 models" in counts


def test_the_budget_is_within_its_limit(choices: dict[str, tuple[Choice, ...]]) -> None:
    (choice,) = choices["pareto"]
    errors = table(choice, "Error on unseen blocks: ")
    assert [row[0] for row in errors.rows] == [1, 2, 3, 6]
    assert errors.marked is not None
    assert str(errors.rows[errors.marked][-1]).split() == list(choice.sensors)
    each = table(choice, "Error on unseen blocks for each")
    assert [row[0] for row in each.rows] == [0, 1, 2, 3, 6]
    assert [np.mean(np.array(row[1:], dtype=float)) for row in each.rows[1:]] == pytest.approx(
        [row[errors.columns.index("ols mean RMS [um]")] for row in errors.rows], rel=0.15
    )  # over all rows, and the mean over the blocks
    assert each.marked == errors.marked + 1


def test_what_to_buy_next_is_what_the_next_row_has_more(choices: dict[str, tuple[Choice, ...]]) -> None:
    (choice,) = choices["pareto"]
    errors, bought = table(choice, "Error on unseen blocks: "), table(choice, "Next sensor to buy")
    for (size, joins, gain, worst, best), row, following in zip(
        bought.rows, errors.rows, errors.rows[1:], strict=False
    ):
        assert size == row[0]
        assert gain == pytest.approx(float(row[1] or 0) - float(following[1] or 0)) == row[2]
        assert isinstance(worst, float)
        assert isinstance(best, float)
        assert worst <= best
        new = set(str(following[-1]).split()) - set(str(row[-1]).split())
        assert joins == (new.pop() if len(new) == 1 else "all 3 others")
    assert any(n.startswith("Next to buy: ") for n in choice.notes)


def test_stand_ins_name_the_copy(choices: dict[str, tuple[Choice, ...]]) -> None:
    """t4_C repeats t1_C; the chosen sensors make up each of the others, and are made up from the others of them."""
    (choice,) = choices["pareto"]
    stands = table(choice, "Virtual sensors")
    assert [row[0] for row in stands.rows] == [f"t{k}_C" for k in range(1, 7)]
    nearest = {str(row[0]): row[1:3] for row in stands.rows}
    assert nearest["t4_C"][0] == "t1_C"
    assert nearest["t1_C"][0] == "t4_C"
    assert float(nearest["t4_C"][1] or 0) < 0.1  # degC
    for name, _, _, parts, _, loses in stands.rows:
        assert str(name) not in str(parts)
        assert str(parts) == "none" or all(p.split()[1] in choice.sensors for p in str(parts).split(", "))
        assert float(loses or 0) >= 0


@pytest.mark.parametrize("method", METHODS)
def test_progress_is_told_piece_by_piece(crowd: Samples, method: str) -> None:
    judging = splits.leave_one_cycle_out(crowd)
    heard: list[str] = []
    selecting.select(method, crowd, judging, SETTINGS, progress=lambda text, steps=1: heard.extend([text] * steps))
    assert len(heard) == selecting.n_pieces(method, crowd, judging, SETTINGS)


def test_nothing_to_choose_from_is_an_error() -> None:
    speed_only = stack([crowded_machine()], ["x_um"], ["spindle_rpm"])
    judging = splits.leave_one_cycle_out(speed_only)
    for method in METHODS:
        with pytest.raises((InputError, FitError), match=r"temperature|complete rows"):
            selecting.select(method, speed_only, judging, SETTINGS)


def test_cells_as_text() -> None:
    assert [format_cell(c) for c in (None, float("nan"), 3, 0.123456, 1e6, "t1_C")] == [
        "",
        "",
        "3",
        "0.1235",
        "1e+06",
        "t1_C",
    ]
    words = Table("t", ("a", "b"), ((1, "x"), (None, "y"))).words
    assert words == (1,)
    assert np.isfinite(Settings().most("ace"))
    assert (Settings().most("ace"), Settings().most("subsets"), Settings(max_sensors=5).most("ace")) == (3, 10, 5)


def test_a_search_that_was_stopped_does_not_claim_the_best(crowd: Samples, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(subsetsearch.Dropping, "chunk", 1)
    monkeypatch.setattr(subsetsearch.Adding, "chunk", 1)
    settings = Settings(max_sensors=3, seconds=1e-9)
    (choice, _) = selecting.select("subsets", crowd, splits.leave_one_cycle_out(crowd), settings)
    shown = table(choice, "Best subset")
    assert any(row[-2] == "not proven" for row in shown.rows)
    assert "cannot be better" not in shown.caption
    assert any("stopped (seconds)" in n for n in choice.notes)

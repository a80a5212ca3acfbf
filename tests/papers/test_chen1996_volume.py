"""The work volume of the virtual machine, learned and compensated (C-01, C-05, C-06, C-08, C-35)."""

from functools import cache

import numpy as np
import pytest

from thermocomp.core.components import COMPONENTS
from thermocomp.papers.chen1996 import anywhere, volume


@cache
def found() -> anywhere.Volume:
    return anywhere.judge(volume.learn(1), 2)


@pytest.mark.long
def test_the_error_at_random_points_and_states_is_ten_times_smaller() -> None:
    sizes = found().sizes
    assert all(len(size) == anywhere.POINTS for size in sizes.values())
    assert found().gain() >= 10.0
    rms = {name: float(np.sqrt(np.mean(size**2))) for name, size in sizes.items()}
    assert rms[anywhere.WITH] < rms[anywhere.LINES] < rms[anywhere.WITHOUT]
    # a machine of a hundredth of a millimetre, not one whose error was blown up to be taken away
    assert 30.0 < rms[anywhere.WITHOUT] < 60.0


@pytest.mark.long
def test_what_is_left_is_told_by_where_it_comes_from() -> None:
    causes = found().causes
    left = causes[anywhere.SPINDLE] + causes[anywhere.AXES_SHARE]
    assert left == pytest.approx(found().errors[anywhere.WITH], abs=0.05)
    # a machine that has not moved yet is not without error: mornings differ
    start = np.linalg.norm(causes[anywhere.START], axis=1)
    assert 0.2 < float(np.sqrt(np.mean(start**2))) < 3.0


def test_first_order_meets_the_truth() -> None:
    assert found().closure < anywhere.CLOSED


def test_the_machine_tells_the_components_that_it_can_measure() -> None:
    told = found().learned.machine.components
    assert {c.code for c in COMPONENTS} - set(told) == {c.code for c in COMPONENTS if c.group == "origin"}
    assert set(found().learned.fits) == {c.code for c in COMPONENTS if c.group == "axis"}


def test_claims_hold_and_say_their_numbers() -> None:
    claims = anywhere.claims(found())
    assert [c.holds for c in claims] == [True, True, True, True, None]
    assert {i for c in claims for i in c.ids} == {"C-01", "C-05", "C-06", "C-08", "C-35"}
    numbers = anywhere.numbers(found())
    assert f"{numbers['volume_gain']:.1f} times" in claims[3].ours


def test_tables_name_all_32_components() -> None:
    sizes, parts = anywhere.tables(found())
    assert [row[0] for row in parts.rows] == [c.code for c in COMPONENTS]
    assert len(sizes.rows) == 3
    (figure,) = anywhere.figures(found())
    assert [len(c.x) for c in figure.panels[0].curves] == [anywhere.POINTS] * 3

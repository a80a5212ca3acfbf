"""Wessel's comparison of linear regression and ACE on a measured machine, as the virtual tool cannot test it (W-08)."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from thermocomp.judging.compare import compare
from thermocomp.judging.splits import leave_one_cycle_out
from thermocomp.papers.common import stacked
from thermocomp.recordings.cycles import find_cycles
from thermocomp.recordings.readers import recordings as files

PAGE = Path(__file__).resolve().parents[2] / "docs" / "studies.rst"
METHODS = ("ols", "ace", "ace-monotone", "averaged")


def errors(shared_data: Path, every: int, methods: Sequence[str], channels: str) -> dict[str, list[float]]:
    """Return the RMS in unseen cycles of fl_thermal by method, for some channels [um]."""
    whole = files.read(shared_data / "fl_thermal" / "recording.csv")
    table, time = whole.table.iloc[::every].reset_index(drop=True), whole.time[::every]
    recording = replace(whole, table=table, time=time, cycles=find_cycles(time, table["spindle_rpm"].to_numpy()))
    samples = stacked([recording], [f"ch{k}_um" for k in channels])
    found = compare(samples, methods, leave_one_cycle_out(samples), limits=None, robustness=False).overall()
    rms = {m: [a.metric("rms") for a in found if a.model == m] for m in methods}
    return {"none": [a.none_metric("rms") for a in found if a.model == "ols"]} | rms


def printed() -> dict[str, list[float]]:
    """Return the table of the page."""
    text = PAGE.read_text(encoding="utf-8").partition("RMS in the unseen cycles [um]")[2]
    rows = re.findall(r"\* - `*(?!method)([a-z-]+)`*\n((?:     - [\d.]+\n){5})", text)
    return {name: [float(c) for c in re.findall(r"[\d.]+", cells)] for name, cells in rows}


def test_the_methods_on_a_measured_machine(shared_data: Path) -> None:
    """Every tenth row: ACE is better than linear regression in channel 1, not in 3; with monotone curves in both."""
    found = errors(shared_data, 10, METHODS[:3], "13")
    (ace_1, ace_3), (linear_1, linear_3) = found["ace"], found["ols"]
    assert ace_1 < 0.95 * linear_1
    assert 1.2 * linear_3 < ace_3 < 0.7 * found["none"][1]
    assert all(m < linear for m, linear in zip(found["ace-monotone"], found["ols"], strict=True))


@pytest.mark.long
def test_the_page_tells_the_errors_of_a_measured_machine(shared_data: Path) -> None:
    told = printed()
    assert [*told] == ["none", *METHODS]
    for method, rms in errors(shared_data, 1, METHODS, "12345").items():
        assert told[method] == pytest.approx(rms, abs=0.051), method

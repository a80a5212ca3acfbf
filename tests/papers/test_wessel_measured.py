"""Wessel's comparison of linear regression and ACE on a measured machine, as the virtual tool cannot test it (W-08)."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from thermocomp.cli.app import run
from thermocomp.judging.compare import compare
from thermocomp.judging.splits import leave_one_cycle_out
from thermocomp.papers.common import stacked
from thermocomp.recordings.cycles import find_cycles
from thermocomp.recordings.readers import recordings as files

DOCS = Path(__file__).resolve().parents[2] / "docs"
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
    """Return the errors of which the table of the page is made."""
    rms = json.loads((DOCS / "measured.json").read_text(encoding="utf-8"))["rms_um"]
    return {method: [errors[f"ch{k}_um"] for k in range(1, 6)] for method, errors in rms.items()}


def test_the_methods_on_a_measured_machine(shared_data: Path) -> None:
    """Every tenth row: ACE is better than linear regression in channel 1, not in 3; with monotone curves in both."""
    found = errors(shared_data, 10, METHODS[:3], "13")
    (ace_1, ace_3), (linear_1, linear_3) = found["ace"], found["ols"]
    assert ace_1 < 0.95 * linear_1
    assert 1.2 * linear_3 < ace_3 < 0.7 * found["none"][1]
    assert all(m < linear for m, linear in zip(found["ace-monotone"], found["ols"], strict=True))


@pytest.mark.long
def test_the_page_tells_the_errors_of_a_measured_machine(shared_data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    told = printed()
    assert [*told] == ["none", *METHODS]
    recording = str(shared_data / "fl_thermal" / "recording.csv")
    # 1: no model may run whose errors with noise and a lost sensor are not known
    assert run(["compare", recording, "--models", *METHODS, "--no-robustness", "--json"]) == 1
    results = json.loads(capsys.readouterr().out)["results"]
    for method in METHODS:
        pooled = [r for r in results if r["model"] == method and r["block"] == "all unseen cycles"]
        assert told[method] == pytest.approx([r["alone_rms_um"] for r in pooled], rel=1e-3), method
        assert told["none"] == pytest.approx([r["none_rms_um"] for r in pooled], rel=1e-3)


def test_the_page_tells_what_its_table_shows() -> None:
    """W-08: the sentences below the table; that of the paper's ACE, and that with monotone curves."""
    rms = {method: np.array(e) for method, e in printed().items()}
    better, worse = (rms["ols"] / rms["ace"])[:2], (rms["ace"] / rms["ols"])[2:]
    monotone = rms["ols"] / rms["ace-monotone"]
    text = " ".join((DOCS / "studies.rst").read_text(encoding="utf-8").split())
    assert ".. measured-table::" in text
    for words, ratios in (
        ("The paper's ACE is {} times better than linear regression in the first two channels", better),
        ("{} times worse in the other three", worse),
        ("With monotone curves it is {} times better in all five channels", monotone),
    ):
        assert words.format(f"{ratios.min():.1f} to {ratios.max():.1f}") in text

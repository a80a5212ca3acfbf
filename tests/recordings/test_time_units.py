"""Times whose stated unit makes a test too slow or too fast: told, never replaced by a guess, settled by a mapping."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray

from thermocomp.cli.app import run
from thermocomp.core.exceptions import TwoReadingsError
from thermocomp.recordings.checks.findings import Finding
from thermocomp.recordings.checks.quality import check
from thermocomp.recordings.readers.mapping import Mapping, TimeColumn
from thermocomp.recordings.readers.mending import Question, mend
from thermocomp.recordings.readers.recordings import read
from thermocomp.recordings.recording import Recording

#: name: unit that the file states, its numbers, likely unit, and what a test of it lasts in hours in both units
FAST = {
    "serial called s": ("s", 45418 + 1 / 3 + np.arange(200) / 1440, "d", 199 / 1440 / 3600, 199 / 60),
    "serial called min": ("min", 45418 + 1 / 3 + np.arange(200) / 1440, "d", 199 / 1440 / 60, 199 / 60),
    "seconds called ms": ("ms", np.arange(200) * 60, "s", 199 / 60 / 1000, 199 / 60),
    "minutes called ms": ("ms", np.arange(200), "min", 199 / 3600 / 1000, 199 / 60),
    "hours called s": ("s", np.arange(480) / 60, "h", 479 / 60 / 3600, 479 / 60),
    "days called min": ("min", np.arange(480) / 1440, "d", 479 / 1440 / 60, 479 / 60),
}
SLOW = {
    "half hours of a hall": ("h", np.arange(480) / 2, "min", 239.5, 239.5 / 60),
    "20 min in s": ("s", np.arange(480) * 1200, "ms", 479 / 3, 479 / 3000),
    "2 h in s": ("s", np.arange(80) * 7200, "ms", 158.0, 0.158),
    "minutes called h": ("h", np.arange(200), "min", 199.0, 199 / 60),
    "epoch called min": ("min", 1714982400 + np.arange(200) * 60, "s", 199.0, 199 / 60),
    "milliseconds called s": ("s", np.arange(500) * 10_000, "ms", 499 * 10 / 3.6, 499 * 10 / 3600),
}
CASES = {**FAST, **SLOW}


def written(folder: Path, unit: str, times: NDArray[Any], below: bool, steep: float = 3.5) -> Path:
    """Write a warm-up by 3 degC, whose half takes a fifth of the test; less if it is steeper."""
    warm = 3 * (1 - np.exp(-np.linspace(0, steep, len(times))))
    noise = np.random.default_rng(4).normal(size=(2, len(times)))
    head = f"Time,T1,Z\n{unit},degC,um\n" if below else f"time_{unit},T1 [degC],Z [um]\n"
    rows = (
        f"{t:.12g},{20 + w + 0.01 * a:.3f},{5 * w + 0.2 * b:.2f}\n"
        for t, w, a, b in zip(times, warm, *noise, strict=True)
    )
    path = folder / "logger.csv"
    path.write_text(head + "".join(rows), encoding="utf-8")
    return path


def of_unit(recording: Recording) -> list[Finding]:
    return [f for f in check(recording) if f.kind == "time unit"]


@pytest.mark.parametrize("below", [True, False])
@pytest.mark.parametrize("case", CASES)
def test_an_implausible_unit_is_told_with_the_likely_one(case: str, below: bool, tmp_path: Path) -> None:
    unit, times, likely, hours, true_hours = CASES[case]
    recording = read(written(tmp_path, unit, times, below))
    assert recording.time[-1] / 3600 == pytest.approx(hours, rel=1e-4)
    (found,) = of_unit(recording)
    assert (found.severity, found.rows) == ("trouble", None)
    assert f"Are the times {likely} (then it lasted" in found.text
    assert f'[time] unit = "{likely}"; if {unit} is right, confirm it there: unit = "{unit}"' in found.text
    lasted = f"{true_hours * 3600:.3g} s" if true_hours * 3600 < 1000 else f"{true_hours:.2f} h"
    assert f"{likely} (then it lasted {lasted})" in found.text
    assert case in SLOW or f"rows are {np.diff(recording.time)[0]:.2g} s apart" in found.text


def test_a_day_called_a_minute_is_told_by_the_haste_of_the_sensors(tmp_path: Path) -> None:
    """Rows 10 ms apart over 86 s alone would be nothing special; the first hour of a day passes in 3.6 s."""
    (found,) = of_unit(read(written(tmp_path, "ms", np.arange(8640) * 10.0, below=True, steep=24.0)))
    assert found.severity == "trouble"
    assert "most temperatures pass half of their range in" in found.text
    assert "Are the times s (then it lasted 24.00 h)" in found.text


@pytest.mark.parametrize("case", CASES)
def test_it_is_never_replaced_by_a_guess(case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    unit, times, likely, *_ = CASES[case]
    path, output = written(tmp_path, unit, times, below=True), tmp_path / "logger.toml"
    assert run(["check", str(path)]) == 1
    capsys.readouterr()
    for more in (["--yes"], ["--json"]):
        assert run(["map", str(path), "-o", str(output), *more]) == 2
        said = " ".join(capsys.readouterr().err.split())
        assert f'[time] unit = "{likely}"; if {unit} is right' in said
        assert not output.exists()


@pytest.mark.parametrize("case", CASES)
def test_a_mapping_settles_it(case: str, tmp_path: Path) -> None:
    """The likely unit is sound; the stated one, confirmed, is a warning: the model may be fitted."""
    unit, times, likely, hours, true_hours = CASES[case]
    path, mapping = written(tmp_path, unit, times, below=True), tmp_path / "begun.toml"
    for said, lasts in ((likely, true_hours), (unit, hours)):
        recording = read(path, Mapping(TimeColumn(unit=said)))
        assert recording.time[-1] / 3600 == pytest.approx(lasts, rel=1e-4)
        assert [f.severity for f in of_unit(recording)] == ["warning"] * (said == unit)
        mapping.write_text(f'[time]\nunit = "{said}"\n', encoding="utf-8")
        assert run(["check", str(path), "--mapping", str(mapping)]) == 0
        assert run(["map", str(path), "--mapping", str(mapping), "--yes"]) == 0


def test_the_question_has_both_units_and_no_answer_beforehand(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    unit, times, *_ = SLOW["half hours of a hall"]
    path, output = written(tmp_path, unit, times, below=True), tmp_path / "hall.toml"
    answers = iter(["", "2"])
    monkeypatch.setattr("builtins.input", lambda: next(answers))
    assert run(["map", str(path), "-o", str(output)]) == 0
    assert "expected a number from 0 to 2" in capsys.readouterr().err
    assert output.read_text(encoding="utf-8") == '[time]\nunit = "h"\n'
    assert run(["check", str(path), "--mapping", str(output)]) == 0
    monkeypatch.setattr("builtins.input", lambda: "0")
    assert run(["map", str(path), "-o", str(tmp_path / "none.toml")]) == 2


def test_a_unit_without_another_is_confirmed(tmp_path: Path) -> None:
    """12 rows of over an hour cannot be milliseconds, as these would be 44 s."""
    path = written(tmp_path, "s", np.arange(12) * 4000, below=True)
    (found,) = of_unit(read(path))
    assert "If s is the right unit, confirm it in a mapping" in found.text
    assert found.remedy == {"time": {"unit": "s"}}
    asked: list[Question] = []
    with pytest.raises(TwoReadingsError):
        mend(path, "", asked.append)
    assert [q.options for q in asked if q.options[0] == found.remedy] == [(found.remedy,)]


def test_a_table_in_memory_states_its_unit_too() -> None:
    for unit, times in (("min", np.arange(200) * 60.0), ("h", np.arange(200) * 2.0)):
        table = pd.DataFrame({f"time_{unit}": times, "t1_C": 20 + np.linspace(0, 3, 200)})
        (found,) = of_unit(Recording.from_dataframe(table))
        assert f"if {unit} is right" in found.text
    passed = pd.DataFrame({"t1_C": 20 + np.linspace(0, 3, 200)}, index=pd.to_timedelta(np.arange(200) * 2, unit="h"))
    (found,) = of_unit(Recording.from_dataframe(passed))
    assert found.remedy is None


# -- near misses ---------------------------------------------------------------------------------------------------


def fast(rate: float, seconds: float, change: float, noise: float) -> Recording:
    """Return a recording of `rate` rows per second [Hz], warming up by `change` [degC]."""
    t = np.arange(0, seconds, 1 / rate)
    rng = np.random.default_rng(3)
    warm = change * (1 - np.exp(-t / seconds * 2))
    table = pd.DataFrame({"time_s": t})
    for k in (1, 2, 3):
        table[f"t{k}_C"] = 20 + warm / k + noise * rng.normal(size=len(t))
    table["z_um"] = 5 * warm + 0.2 * rng.normal(size=len(t))
    return Recording.from_dataframe(table)


@pytest.mark.parametrize(
    ("rate", "seconds", "change", "noise"),
    [
        (10, 600, 3.0, 0.02),
        (10, 90, 2.0, 0.02),
        (1000, 120, 1.5, 0.0),
        (1000, 120, 3.0, 0.1),  # noise from row to row of a tenth of the range, in many rows
        (100, 300, 0.0, 0.05),
        (1, 40, 3.0, 0.01),
        (2, 30, 3.0, 0.01),
    ],
)
def test_a_fast_recording_is_none(rate: float, seconds: float, change: float, noise: float) -> None:
    assert of_unit(fast(rate, seconds, change, noise)) == []


def test_a_burst_without_warming_is_a_warning() -> None:
    assert [f.severity for f in of_unit(fast(100, 20, 0.0, 0.05))] == ["warning"]
    assert [f.severity for f in of_unit(fast(1000, 0.5, 0.0, 0.05))] == ["trouble"]

"""Recordings under compensation: a model learns what the machine does by itself, or is refused."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from smallmachine import small_machine

import thermocomp as tc
from thermocomp.core.exceptions import InputError, RecordingError
from thermocomp.core.machine import Channel
from thermocomp.recordings.checks.quality import check
from thermocomp.recordings.compensated import beside, refuse_compensated
from thermocomp.recordings.headings import understand
from thermocomp.recordings.readers import recordings
from thermocomp.recordings.readers.mapping import Mapping, read_mapping
from thermocomp.recordings.recording import Recording


def compensated(drop: str = "", **columns: float) -> Recording:
    """A drift test under a correction, with all three columns but for those to drop."""
    plain = small_machine()
    c = -5.0 * np.sin(plain.time / 9000.0)
    more = {"z_residual_um": plain.table["z_um"] + c, "z_correction_um": c}
    table = pd.DataFrame({**plain.table, **more, **columns}).drop(columns=drop.split())
    kinds = {"z_residual_um": "residual", "z_correction_um": "correction"}
    every = (*plain.channels, *(Channel(n, q, "um") for n, q in kinds.items()))
    channels = tuple(next(c for c in every if c.name == n) for n in table.columns)
    return replace(plain, table=table, channels=channels)


def test_headings_and_names() -> None:
    quantities = {
        "z_residual_um": "residual",
        "z correction [mm]": "correction",
        "Residual Z (um)": "residual",
        "z_um": "displacement",
        "corrections_um": "displacement",
        "x_mm": "position",
    }
    for heading, quantity in quantities.items():
        found = understand(heading)
        assert found is not None
        assert found.unit.quantity == quantity, heading
    assert beside("z_um") == ("z_residual_um", "z_correction_um")
    assert beside("Z") == ("Z_residual_um", "Z_correction_um")


def test_what_fits_together_passes() -> None:
    refuse_compensated([compensated(), small_machine()], ["z_um", "x_um"])
    refuse_compensated([replace(compensated(), compensation="known")], ["z_um"])
    refuse_compensated([compensated("z_correction_um")], ["z_um"])
    refuse_compensated([compensated("z_residual_um", z_correction_um=0.0)], ["z_um"])
    shifted = compensated()
    shifted.table["z_um"] += 100.0  # counts from another zero
    refuse_compensated([shifted], ["z_um"])


def test_targets_are_what_a_model_can_learn() -> None:
    assert [c.name for c in compensated().displacements] == ["z_um", "x_um"]
    with pytest.raises(InputError, match="input z_correction_um is a correction: it is the output of a model"):
        tc.fit(compensated(), "z_um", inputs=["t1_C", "z_correction_um"], jobs=1)
    with pytest.raises(InputError, match="input z_residual_um is a residual"):
        tc.fit(compensated(), "z_um", inputs=["t1_C", "z_residual_um"], jobs=1)


@pytest.mark.parametrize(
    ("recording", "target", "text"),
    [
        (
            replace(compensated(), compensation="unknown"),
            "x_um",
            'small: compensation: unknown: .* compensation = "off"',
        ),
        (compensated(), "z_residual_um", r"z_residual_um was recorded .*\(residual\): .* as the target, z_um"),
        (compensated(), "z_correction_um", r"z_correction_um was recorded .*\(correction\): .* as the target, z_um"),
        (compensated("z_um"), "z_um", "there is z_residual_um, .* add a column z_um = z_residual_um - z_corr"),
        (compensated("z_residual_um"), "z_um", "z_um was measured while z_correction_um was in force"),
        (
            compensated(z_um=np.nan),
            "z_um",
            "z_um is empty where z_residual_um has a value: compensation: unknown: the correction in force",
        ),
    ],
)
def test_what_is_refused(recording: Recording, target: str, text: str) -> None:
    with pytest.raises(RecordingError, match=text):
        refuse_compensated([recording], [target])
    for verb in (tc.fit, tc.compare):
        with pytest.raises(RecordingError, match=text):
            verb(recording, target, jobs=1)


def test_a_sum_of_the_wrong_sign_is_found() -> None:
    wrong = compensated()
    wrong.table["z_um"] = wrong.table["z_residual_um"] + wrong.table["z_correction_um"]
    with pytest.raises(RecordingError, match=r"in row \d+ z_um is .* they must be equal; name the uncompensated"):
        refuse_compensated([wrong], ["z_um"])
    refuse_compensated([replace(wrong, changed=("z_um: cut",))], ["z_um"])
    refuse_compensated([wrong], ["x_um"])
    rounded = compensated()
    rounded.table["z_um"] = rounded.table["z_um"].round(1)
    refuse_compensated([rounded], ["z_um"])


def test_assess_refuses_too(tmp_path: Path) -> None:
    tc.fit(small_machine(), "z_um", model="ols", jobs=1).save(tmp_path / "model.json")
    unknown = replace(small_machine(seed=1), compensation="unknown")
    with pytest.raises(RecordingError, match="compensation: unknown"):
        tc.assess(tmp_path / "model.json", unknown)


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
@pytest.mark.parametrize("state", ["", "off", "known", "unknown"])
def test_a_file_says_it(state: str, ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"drift{ending}"
    written = replace(compensated(), compensation=state)
    recordings.write(written, path)
    again = recordings.read(path)
    assert again.compensation == state
    assert again.channels == written.channels
    assert recordings.read(path, Mapping(compensation="off")).compensation == "off"


def test_a_spreadsheet_loses_no_role(tmp_path: Path) -> None:
    recordings.write(replace(compensated(), compensation="known"), tmp_path / "drift.csv")
    pd.read_csv(tmp_path / "drift.csv", comment="#").to_csv(tmp_path / "again.csv", index=False)
    again = recordings.read(tmp_path / "again.csv")
    assert [c.quantity for c in again.channels][-2:] == ["residual", "correction"]


def test_a_mapping_says_it(tmp_path: Path) -> None:
    (tmp_path / "m.toml").write_text(
        'compensation = "unknown"\n[columns.z_residual_um]\ncolumn = "left_um"\nrole = "residual"\n'
        '[columns.z_correction_um]\ncolumn = "added_mm"\nrole = "correction"\n'
    )
    (tmp_path / "d.csv").write_text("time_s,t1_C,left_um,added_mm\n0,20,1,0.002\n60,21,2,0.003\n")
    found = recordings.read(tmp_path / "d.csv", read_mapping(tmp_path / "m.toml"))
    assert found.compensation == "unknown"
    assert [(c.name, c.quantity, c.unit) for c in found.channels][1:] == [
        ("z_residual_um", "residual", "um"),
        ("z_correction_um", "correction", "um"),
    ]
    assert found.table["z_correction_um"].tolist() == [2.0, 3.0]
    (tmp_path / "m.toml").write_text('compensation = "perhaps"\n')
    with pytest.raises(InputError, match=r"m\.toml: .*compensation.*perhaps"):
        read_mapping(tmp_path / "m.toml")


def test_check_says_it() -> None:
    kinds = [(f.severity, f.kind) for f in check(replace(compensated(), compensation="unknown"))]
    assert ("trouble", "compensation") in kinds
    held = compensated()
    held.table["z_correction_um"] = -5.0  # a correction that is held is no dead sensor
    held.table["z_residual_um"] = held.table["z_um"] - 5.0
    assert [f for f in check(replace(held, compensation="known")) if f.severity == "trouble"] == []
    sparse = compensated()
    sparse.table.loc[sparse.table.index % 60 != 0, ["z_um", "z_residual_um"]] = np.nan  # probings
    assert [f for f in check(sparse) if f.severity == "trouble"] == []

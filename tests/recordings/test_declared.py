"""Header data, uncertainty and workpiece in a mapping: what is wrong is told, and files that we write keep the rest."""

from dataclasses import replace
from pathlib import Path

import pytest
from smallmachine import small_machine

from thermocomp.core.exceptions import InputError
from thermocomp.recordings.declared import Declared, ExpandingBody, HeaderData, MeasuringUncertainty, Workpiece
from thermocomp.recordings.joining import join_two
from thermocomp.recordings.readers import recordings
from thermocomp.recordings.readers.mapping import read_mapping

TEXT = """
[test]
machine = "VMC 3"
date = 2026-03-01

[uncertainty]
probe_um = 0.3
misalignment_deg = 1

[expansion.fixture]
length_mm = 250
coefficient_um_per_m_K = 11.5
variation_K = 0.4

[workpiece]
length_mm = 300
coefficient_um_per_m_K = 23
temperature = "t1_C"
"""
DECLARED = Declared(
    HeaderData(machine="VMC 3", date="2026-03-01"),
    MeasuringUncertainty(probe_um=0.3, misalignment_deg=1.0),
    {"fixture": ExpandingBody(250.0, 11.5, 0.4)},
    Workpiece(300.0, 23.0, "t1_C"),
)


def test_the_tables_are_read(tmp_path: Path) -> None:
    (tmp_path / "m.toml").write_text(TEXT)
    assert read_mapping(tmp_path / "m.toml").declared == DECLARED


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("[uncertainty]\nprobe_um = -0.3", ["[uncertainty]: probe_um = -0.3", "from 0 to 1000", "leave the key out"]),
        ("[uncertainty]\nprobe_mm = 0.3", ["table [uncertainty]", "'probe_mm'", "did you mean 'probe_um'?"]),
        ("[uncertainty]\nprobe_um = '0.3 um'", ["table [uncertainty]", "'probe_um' = '0.3 um'", "valid number"]),
        ("[uncertainty]\nmisalignment_deg = 90", ["misalignment_deg = 90", "from 0 to 45"]),
        (TEXT.replace("11.5", "11.5e-6"), ["[expansion.fixture]: coefficient_um_per_m_K = 1.15e-05", "from 0.01"]),
        (TEXT.replace("length_mm = 250", "length_in = 10"), ["table [expansion.fixture]", "did you mean 'length_mm'?"]),
        (TEXT.replace("variation_K = 0.4", ""), ["table [expansion.fixture]: key 'variation_K' is missing; add it"]),
        (TEXT.replace("length_mm = 300", "length_mm = -300"), ["[workpiece]: length_mm = -300", "correct the number"]),
        ("[test]\nserial = 4711", ["table [test]", "'serial' = 4711", "valid string"]),
    ],
)
def test_a_wrong_entry_is_told_by_file_and_key(tmp_path: Path, text: str, parts: list[str]) -> None:
    path = tmp_path / "m.toml"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        read_mapping(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert [part for part in parts if part not in str(caught.value)] == []


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
def test_files_that_we_write_keep_them(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"drift{ending}"
    recordings.write(replace(small_machine(dt=600.0), declared=DECLARED), path)
    assert recordings.read(path).declared == DECLARED
    # a mapping given for the file comes first, entry by entry
    (tmp_path / "m.toml").write_text("[test]\nmachine = 'VMC 4'\n[uncertainty]\nprobe_um = 0.1\n")
    found = recordings.read(path, read_mapping(tmp_path / "m.toml")).declared
    assert found.test == HeaderData(machine="VMC 4", date="2026-03-01")
    assert found.uncertainty == MeasuringUncertainty(probe_um=0.1, misalignment_deg=1.0)
    assert (found.expansion, found.workpiece) == (DECLARED.expansion, DECLARED.workpiece)


def test_a_joined_recording_keeps_them() -> None:
    whole = small_machine()
    temperatures, probes = (
        replace(whole, table=whole.table[[c.name for c in channels]], channels=channels)
        for channels in (whole.temperatures, whole.displacements)
    )
    found, _ = join_two(temperatures, replace(probes, declared=DECLARED), 0.0)
    assert found.declared == DECLARED

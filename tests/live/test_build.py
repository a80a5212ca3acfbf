"""The service that a configuration describes."""

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest
from driftmodels import ACCEPTED
from smallmill import warmed, write_mill

from thermocomp.core.exceptions import InputError
from thermocomp.core.reading import Reading
from thermocomp.files import modelfile, positionfile
from thermocomp.live import statefile
from thermocomp.live.build import build
from thermocomp.live.config import read_config

CONFIG = """
state = "state.json"
[limits]
rate = 1e6
[[sources]]
kind = "mqtt"
topic = "m"
"""


def configured(folder: Path, text: str) -> Path:
    path = folder / "serve.toml"
    path.write_text(text + CONFIG if text.startswith("models") else CONFIG + text, encoding="utf-8")
    return path


def judged_mill(folder: Path) -> None:
    write_mill(folder)
    (exx,) = positionfile.loads((folder / "exx.json").read_text(encoding="utf-8"))
    slopes = tuple(replace(m, honest_error=ACCEPTED) for m in exx.slopes)
    positionfile.write([replace(exx, slopes=slopes)], folder / "exx.json", overwrite=True)
    (drift,) = modelfile.read(folder / "drift.json")
    modelfile.write([replace(drift, honest_error=ACCEPTED)], folder / "drift.json", overwrite=True)


def test_a_machine_is_corrected_by_offset_and_slope_of_each_axis(tmp_path: Path) -> None:
    judged_mill(tmp_path)
    text = '[machine]\nfile = "mill.toml"\nat = [300.0, 100.0, 250.0]\n'
    service = build(read_config(configured(tmp_path, text)))
    now = service.clock.now()
    service.take(Reading(now, {"t1_C": 20.0}))
    service.take(Reading(now, {"t1_C": 24.0}))
    found = service.state.corrections
    assert set(found) == {"X", "Y", "Z"}
    at = {p: found["X"].at(p) for p in (0.0, 600.0)}
    # 2 um/m per degC along X, beside a profile of at most 1 um
    assert at[600.0] - at[0.0] == pytest.approx(-4.0 * 2.0 * 0.6, abs=1.0)
    assert found["Z"].offset == pytest.approx(-3.0 * 4.0, abs=1e-9)
    statefile.write(service.state, service.compensator, tmp_path / "state.json", datetime.now(UTC))
    again = build(read_config(tmp_path / "serve.toml"))
    assert again.state.corrections == found


def test_a_model_of_time_and_position_is_a_line(tmp_path: Path) -> None:
    judged_mill(tmp_path)
    service = build(read_config(configured(tmp_path, 'models = ["exx.json", "drift.json"]\n')))
    assert set(service.compensator.lines) == {"EXX", "z_um"}
    assert service.compensator.lines["EXX"].travel == (0.0, 600.0)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "name at least one model file"),
        ('models = ["drift.json"]\n[machine]\nfile = "mill.toml"\nat = [0.0, 0.0, 0.0]\n', "but not both"),
        ('[machine]\nfile = "mill.toml"\nat = [0.0, 0.0]\n', "machine.at.3 is missing"),
    ],
)
def test_what_is_wrong_with_a_machine(text: str, says: str, tmp_path: Path) -> None:
    path = tmp_path / "serve.toml"
    head, _, tail = text.partition("\n[")
    path.write_text(f"{head}\n{CONFIG}\n" + (f"[{tail}" if tail else ""), encoding="utf-8")
    if text.startswith("[machine]"):
        path.write_text(CONFIG + text, encoding="utf-8")
    with pytest.raises(InputError, match=says):
        read_config(path)


def test_what_a_configuration_names_has_to_fit(tmp_path: Path) -> None:
    judged_mill(tmp_path)
    sink = '[[sinks]]\nkind = "linuxcnc"\nsocket = "s"\naxes = {x_um = "X"}\n'
    path = tmp_path / "serve.toml"
    path.write_text(f'models = ["drift.json"]\nown_compensation = "off"\n{CONFIG}\n{sink}', encoding="utf-8")
    with pytest.raises(InputError, match="no model for x_um; there are z_um"):
        build(read_config(path))
    modelfile.write([warmed("z_um", "um", 1.0)], tmp_path / "drift.json", overwrite=True)
    path.write_text(f'models = ["drift.json"]\n{CONFIG}', encoding="utf-8")
    with pytest.raises(InputError, match="judged"):
        build(read_config(path))


def test_all_files_and_folders_that_are_not_there_are_said_at_once(tmp_path: Path) -> None:
    (tmp_path / "folder.json").mkdir()
    text = """models = ["a.json", "b.json"]
state = "none/state.json"
own_compensation = "off"
[[sources]]
kind = "replay"
file = "c.csv"
[[sinks]]
kind = "file"
file = "folder.json"
[journal]
file = "nowhere/live.db"
[page]
token_file = "token.txt"
"""
    path = tmp_path / "serve.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        build(read_config(path))
    said = str(caught.value)
    for word in ("a.json: no", "b.json: no", "c.csv: no", "token.txt: no", "none", "folder.json: this is a", "nowhere"):
        assert word in said
    assert len(said.splitlines()) == 8
    assert sorted(p.name for p in tmp_path.iterdir()) == ["folder.json", "serve.toml"]

"""``thermocomp position``: from profiles to a file that the machine's model can use."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from profilemachine import profiles

from thermocomp.cli.app import run
from thermocomp.files import positionfile
from thermocomp.volumetric.commands import positiontables


@pytest.fixture
def wide(tmp_path: Path) -> Path:
    made = profiles(noise=0.1)
    table = made.states.table.copy()
    table.insert(0, "time_s", made.states.time)
    table = table.assign(**{f"y_laser_{p:g}_um": v for p, v in zip(made.position, made.values.T, strict=True)})
    path = tmp_path / "wide.csv"
    table.assign(cycle=[c.name for c in made.states.cycles for _ in range(len(c))]).to_csv(path, index=False)
    return path


def test_a_table_for_people(wide: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "eyy.json"
    assert run(["position", str(wide), "--component", "EYY", "--model", "ols", "-o", str(output), "--details"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "EYY: 72 profiles of 12 points along Y, 0 to 550 mm" in said
    assert "Cold profile: polynomial of order 5" in said
    assert "k1 [um/m] = " in said
    assert "standard errors: t1_C 0.0" in said
    assert "leave one thermal cycle out (3 cycles)" in said
    for day in ("day 1", "day 2", "day 3"):
        assert day in said
    assert "accepted EYY" in said
    (model,) = positionfile.read(output)
    assert model.target == "EYY"
    assert model.slopes[0].accepted
    assert model.slopes[0].coefficients_by_name()["t1_C"] == pytest.approx(3.0, abs=0.1)


def test_numbers_for_machines(wide: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "eyy.json"
    arguments = ["position", str(wide), "--component", "EYY", "--columns", "y_laser_*", "--model", "ols"]
    options = ["--inputs", "t1_C", "t2_C", "--slopes", "2", "--offset", "--order", "4", "--reference", "0", "1"]
    assert run([*arguments, *options, "-o", str(output), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert [f["power"] for f in told["factors"]] == [0, 1, 2]
    assert [f["unit"] for f in told["factors"]] == ["um", "um/m", "um/m^2"]
    assert told["profile"] == {"kind": "polynomial", "order": [4, 0], "tried": []}
    assert told["enough"] == 1
    assert told["overall"]["none_rms"] > 5.0
    assert told["file"] == str(output)
    assert told["verdict"] == "accepted"
    assert positionfile.read(output)[0].powers == (0, 1, 2)


def test_long_tables_splines_and_another_judging(
    wide: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = pd.read_csv(wide)
    tall = table.melt([c for c in map(str, table) if "laser" not in c], var_name="y_mm", value_name="error_um")
    tall["y_mm"] = tall["y_mm"].str.extract(r"_(\d+)_").astype(float)
    path = tmp_path / "long.csv"
    tall.sort_values(["time_s", "y_mm"]).to_csv(path, index=False)
    arguments = ["position", str(path), "--component", "EYY", "--model", "ols", "--json"]
    assert run([*arguments, "--layout", "long", "--profile", "spline"]) == 0
    spline = json.loads(capsys.readouterr().out)
    assert spline["profile"]["kind"] == "spline"
    assert run([*arguments, "--split", "0.7/0.3"]) == 0
    assert "first 70% of the rows" in json.loads(capsys.readouterr().out)["judging"]


def test_a_refused_model_is_written_with_its_refusal(
    wide: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = pd.read_csv(wide)
    day = table["cycle"] == "day 2"
    for name in (c for c in map(str, table) if "laser" in c):
        table[name] = table[name].where(~day, 2 * table[name].iloc[0] - table[name])
    table.to_csv(wide, index=False)
    output = tmp_path / "eyy.json"
    assert run(["position", str(wide), "--component", "EYY", "--model", "ols", "-o", str(output), "--details"]) == 1
    assert "refused EYY" in " ".join(capsys.readouterr().out.split())
    assert not positionfile.read(output)[0].slopes[0].accepted


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--component", "EXX"], "seem to contain Y, not EXX"),
        (["--component", "EAY"], "no column is like y_laser_250_urad"),
        (["--component", "E"], "E: it is not the name of an error component; give an error component such as EYY"),
        (["--component", "EYY", "--columns", "x_*"], "no column is called 'x_*'"),
        (["--component", "EYY", "--model", "gp"], "gp cannot be stored as coefficients"),
        (["--component", "EYY", "--model", "magic"], "magic"),
        (["--component", "EYY", "--reference", "99"], "reference state [99]: expected numbers from 0 to 71"),
        (["--component", "EYY", "--slopes", "12"], "12 coefficients cannot be fitted to 11 positions"),
        (["--component", "EYY", "--inputs", "t9_C"], "no channel is named 't9_C'"),
        (["--component", "EYY", "--positions", "none.toml"], "none.toml: no such file of positions"),
        (["--component", "EYY", "--leave-one-file-out"], "needs at least two recordings"),
    ],
)
def test_what_cannot_be_used(
    options: list[str], message: str, wide: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "eyy.json"
    assert run(["position", str(wide), *options, "-o", str(output)]) == 2
    assert message in " ".join(capsys.readouterr().err.split())
    assert not output.exists()


def test_nothing_is_written_over(wide: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "eyy.json"
    output.write_text("precious", encoding="utf-8")
    assert run(["position", str(wide), "--component", "EYY", "-o", str(output)]) == 2
    assert "exists already" in capsys.readouterr().err
    assert run(["position", str(wide), "--component", "EYY", "-o", str(wide), "--overwrite"]) == 2
    assert "is also an input" in capsys.readouterr().err
    assert output.read_text(encoding="utf-8") == "precious"


# -- several components ----------------------------------------------------------------------------------------------


@pytest.fixture
def machine(tmp_path: Path) -> list[Path]:
    """Return three days: EYY warms by a slope, EXY is noise, EAY shifts as a whole; EYY with Z elsewhere too."""
    paths = []
    for day in range(3):
        made = profiles(noise=0.1, seed=day, n_cycles=1)
        change = (made.states.table - made.states.table.iloc[0]).to_numpy()[:, :1]
        rng = np.random.default_rng(day)
        still = np.linspace(-3, 3, 12) + 0.2 * rng.normal(size=made.values.shape)
        errors = {
            "EYY_{}_um": made.values,
            "EXY_{}_um": still,
            "EAY_{}_urad": still + 2.0 * change,
            "EYY_z600_{}_um": made.values,
        }
        columns = {
            name.format(f"{p:g}"): values[:, k] for name, values in errors.items() for k, p in enumerate(made.position)
        }
        table = pd.concat([made.states.table, pd.DataFrame(columns)], axis=1)
        table.insert(0, "time_s", made.states.time)
        paths.append(tmp_path / f"day{day}.csv")
        table.to_csv(paths[-1], index=False)
    return paths


def test_all_components_in_one_file(machine: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "axes.json"
    assert (
        run(["position", *map(str, machine), "--component", "all", "--model", "ols", "-o", str(output), "--details"])
        == 0
    )
    said = " ".join(capsys.readouterr().out.split())
    assert "3 components, 72 profiles of each in 3 recording(s)" in said
    assert "note not taken: EYY_z600_0_um to EYY_z600_550_um" in said
    assert "Judged on: leave one file out (3 files); settings are selected again in each fold" in said
    assert "cold profile only EXY: the thermal part is omitted: it is noise" in said
    models = {m.target: m for m in positionfile.read(output)}
    assert {code: m.powers for code, m in models.items()} == {"EXY": (), "EYY": (1,), "EAY": (0,)}
    assert all(part.accepted for m in models.values() for part in m.models)


def test_several_for_machines(machine: list[Path], capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["position", *map(str, machine), "--component", "EYY", "EAY", "--model", "ols", "--json"]
    assert run([*arguments, "--no-offset", "--leave-one-cycle-out", "--absolute", "--jobs", "1"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert [c["target"] for c in told["components"]] == ["EYY", "EAY"]
    assert told["components"][0]["chosen_by_profiles"] == ["slopes", "reference_position"]
    assert told["components"][1]["factors"][0]["power"] == 1
    assert "thermal cycle" in told["judging"]
    assert told["file"] is None


def test_settings_are_told_and_can_be_given(machine: list[Path], capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["position", *map(str, machine), "--component", "EYY", "--model", "ols"]
    assert run([*arguments, "--details"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "Determined from the profiles: --slopes 1 --no-offset --reference-position 0" in said
    assert run([*arguments, "--slopes", "1", "--no-offset", "--reference-position", "300", "--details"]) == 1
    said = " ".join(capsys.readouterr().out.split())
    assert "Chosen by" not in said
    assert "selected again" not in said
    assert "do not tilt about 300 mm" in said
    assert run([*arguments, "--slopes", "0", "--details"]) == 0
    assert "k1 [um/m] =" not in capsys.readouterr().out


def test_long_formulas_and_many_cycles_are_shortened(
    machine: list[Path], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(positiontables, "FORMULA", 30)
    monkeypatch.setattr(positiontables, "FEW", 2)
    monkeypatch.setattr(positiontables, "WORST", 1)
    assert run(["position", *map(str, machine), "--component", "EYY", "--model", "ols", "--details"]) == 0
    said = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert "... and 1 more terms (see --json)" in said
    assert "standard errors" not in said
    assert "the 1 worst of 3; RMS over all points in um" in said
    assert said.count(" day0 ") + said.count(" day1 ") + said.count(" day2 ") == 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["all", "--columns", "y_*"], "are for one component"),
        (["EYY", "EXY", "--layout", "long"], "are for one component"),
        (["EYY", "EBY"], "no column is named after EBY, such as EBY_250_urad"),
        (["all", "--jobs", "0"], "--jobs 0"),
        (["all", "--split", "0.5/0.5", "--leave-one-cycle-out"], "exclude each other"),
    ],
)
def test_what_cannot_be_done_with_several(
    options: list[str], message: str, machine: list[Path], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["position", *map(str, machine), "--component", *options]) == 2
    assert message in " ".join(capsys.readouterr().err.split())


def test_the_help_is_the_docstring(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["position", "--help"]) == 0
    said = " ".join(capsys.readouterr().out.replace("│", " ").split())
    for option in ("--component", "--columns", "--layout", "--slopes", "--reference", "--json"):
        assert option in said
    assert "States of each test that count as cold" in said


def test_one_state_has_no_thermal_part(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "one.csv"
    path.write_text("time_s,t_nut_C,y_0_um,y_100_um,y_200_um\n0,20,0,1,2\n", encoding="utf-8")
    assert run(["position", str(path), "--component", "EYY", "-o", str(tmp_path / "eyy.json")]) == 2
    assert "1 thermal state(s)" in capsys.readouterr().err

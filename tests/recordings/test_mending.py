"""What is found wrong with a file comes with what of a mapping mends it; an error offers the whole mapping."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from smallmachine import small_machine

from thermocomp.cli.app import run
from thermocomp.core.exceptions import InputError, RecordingError, TwoReadingsError
from thermocomp.recordings.checks.quality import check
from thermocomp.recordings.readers.mapping import Mapping, read_mapping
from thermocomp.recordings.readers.mending import Draft, Question, mend, read_or_offer, take_best, to_toml
from thermocomp.recordings.readers.recordings import read

Spoil = Callable[[pd.DataFrame], None]


def written(path: Path, spoil: Spoil | None = None, headings: dict[str, str] | None = None) -> Path:
    """Write the small machine's test, spoilt, with headings in the file's own words."""
    table = small_machine().to_frame()
    if spoil is not None:
        spoil(table)
    table.rename(columns=headings or {}).to_csv(path, index=False)
    return path


def kelvin(t: pd.DataFrame) -> None:
    t["t2_C"] += 273.15


def millimetres(t: pd.DataFrame) -> None:
    t[["z_um", "x_um"]] /= 1000


def spikes(t: pd.DataFrame) -> None:
    t.loc[[50, 51, 300], "z_um"] += 900.0


def wild(t: pd.DataFrame) -> None:
    t.loc[400, "t3_C"] = 4000.0


def code(t: pd.DataFrame) -> None:
    t.loc[100:110, "t1_C"] = -127.0


def absent(t: pd.DataFrame) -> None:
    t["t3_C"] = -180.0


def stuck(t: pd.DataFrame) -> None:
    t.loc[200:400, "t1_C"] = float(t["t1_C"].iloc[200])


def step(t: pd.DataFrame) -> None:
    t.loc[330:, "z_um"] += 60.0


def swapped(t: pd.DataFrame) -> None:
    t["t2_C"] += 8.0
    t.loc[430:, ["t1_C", "t2_C"]] = t.loc[430:, ["t2_C", "t1_C"]].to_numpy()


def clock(t: pd.DataFrame) -> None:
    for name in ("t1_C", "t2_C", "t3_C"):
        t[name] = t[name].shift(-25)


def not_zeroed(t: pd.DataFrame) -> None:
    t["z_um"] += 70.0


def twice(t: pd.DataFrame) -> None:
    t["t4_C"] = t["t1_C"]


def irregular(t: pd.DataFrame) -> None:
    t["time_s"] += np.random.default_rng(3).uniform(0, 25, len(t))


@pytest.mark.parametrize(
    ("spoil", "kind"),
    [
        (kelvin, "unit"),
        (millimetres, "unit"),
        (spikes, "spike"),
        (wild, "implausible"),
        (code, "missing-value code"),
        (absent, "missing-value code"),
        (stuck, "stuck"),
        (step, "step"),
        (swapped, "swapped"),
        (clock, "clock"),
        (not_zeroed, "not zeroed"),
        (twice, "duplicate channel"),
        (irregular, "irregular sampling"),
    ],
)
def test_what_check_finds_is_mended_by_what_it_names(spoil: Spoil, kind: str, tmp_path: Path) -> None:
    path = written(tmp_path / "drift.csv", spoil, {"t1_C": "Lager [°C]", "z_um": "Weg Z (µm)"})
    assert kind in {f.kind for f in check(read(path))}

    mended = mend(path, "", lambda q: None if q.severity == "info" else q.options[0])

    assert kind not in {f.kind for f in check(mended.recording)}, mended.text
    again = tmp_path / "again.toml"
    again.write_text(mended.text, encoding="utf-8")
    assert read(path, read_mapping(again)).fingerprint == mended.recording.fingerprint


def test_a_knocked_probe_and_exchanged_sensors_are_as_they_were(tmp_path: Path) -> None:
    sound = small_machine()
    for spoil, names in ((step, ["z_um"]), (swapped, ["t1_C", "t2_C"])):
        mended = mend(written(tmp_path / "drift.csv", spoil), "", lambda q: q.options[0]).recording
        right = sound.table[names] + (np.array([0.0, 8.0]) if spoil is swapped else 0.0)
        np.testing.assert_allclose(mended.table[names], right, atol=0.3)


def test_a_code_in_another_unit_is_cut_where_it_stands(tmp_path: Path) -> None:
    def in_kelvin(t: pd.DataFrame) -> None:
        code(t)
        t["t1_C"] += 273.15

    path = written(tmp_path / "drift.csv", in_kelvin, {"t1_C": "t1 [K]"})
    mended = mend(path, "", take_best)
    assert np.flatnonzero(mended.recording.table["t1_C"].isna()).tolist() == list(range(100, 111))
    assert "missing" not in mended.text.replace("missing-value", "")


def test_the_best_guess_leaves_warnings_alone_and_moves_nothing(tmp_path: Path) -> None:
    for spoil in (step, swapped, clock, irregular, not_zeroed):
        path = written(tmp_path / "drift.csv", spoil)
        assert mend(path, "", take_best).text == ""


def test_times_count_from_the_first_row_of_the_file_behind_a_cut(tmp_path: Path) -> None:
    path = written(tmp_path / "drift.csv", spikes)
    begun = '# of logger 7\n[[clean]]\ndo = "cut"\ntimes = [[0.0, 600.0]]\n'
    mended = mend(path, begun, take_best)
    assert mended.text.startswith("# of logger 7\n")
    assert mended.recording.origin == 660.0
    assert mended.recording.time[0] == 0
    gone = np.flatnonzero(mended.recording.table["z_um"].isna()) + 11
    assert gone.tolist() == [50, 51, 300]
    assert mended.recording.notes[-1] == "cut: 3 of 789 values of z_um (spike): line 52 to 53, line 302"


def test_a_draft_keeps_what_stands_there() -> None:
    draft = Draft('# mine\n[columns.front]\ncolumn = "T1" # behind the lamp\nrole = "temperature"\n')
    assert draft.add({"columns": {"T1_C": {"column": "T1", "missing": [-127.0]}}})
    assert draft.add({"columns": {"T1_C": {"column": "T1", "missing": [-127.0, 85.0]}}, "read": {"skip": [4]}})
    assert not draft.add({"read": {"skip": [4]}})
    assert draft.text == (
        '# mine\n[columns.front]\ncolumn = "T1" # behind the lamp\nrole = "temperature"\nmissing = [-127.0, 85.0]\n\n'
        "[read]\nskip = [4]\n"
    )
    assert Draft().text == to_toml({}) == ""


def offered(error: InputError) -> tuple[str, str]:
    """Return the words and the mapping of an error's offer."""
    (note,) = error.__notes__
    words, _, toml = note.partition("\n\n")
    return words, toml


@pytest.mark.parametrize(
    ("content", "message", "rows"),
    [
        ("time_s,T1,T2,Z\n0,20.1,20.2,0.1\n10,20.3,20.3,1.2\n", "none of the columns", 2),
        ("time_s,T1 [C],T1 [C],Z [um]\n0,20.1,20.2,0.1\n10,20.3,20.3,0.2\n", "are both named", 2),
        ("time_s,T1 [C],Z [um]\n0,20.1,0.1\n10,20.3\n20,20.3,0.2\n", "line 3 has 2 cells", 2),
        ("time_s,T1 [C],Z [um]\n0,20.1,0.1\n10,warm,0.1\n20,20.3,0.2\n", "'warm' is not a number", 2),
        ("time_s,T1 [C],T1 (C),Z [um]\n0,20.1,20.0,0.1\n10,20.4,20.0,0.1\n", "would both become channel", 2),
        ("time_s,T1 [C],cycle\n0,20.1,a\n10,20.4,\n20,20.4,a\n", "the label of the thermal cycle is missing", 2),
    ],
)
def test_an_error_offers_a_mapping_that_reads_the_file(content: str, message: str, rows: int, tmp_path: Path) -> None:
    path = tmp_path / "my file (1).csv"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(InputError, match=message) as caught:
        read_or_offer(path)
    words, toml = offered(caught.value)
    assert words.startswith("this mapping reads it; check it, save it as my_file_1_.toml and give it")
    mapping = tmp_path / "my_file_1_.toml"
    mapping.write_text(toml, encoding="utf-8")
    assert len(read_or_offer(path, read_mapping(mapping))) == rows


@pytest.mark.parametrize(
    ("heading", "message"), [("elapsed", "has no unit: seconds"), ("nr", "no time column"), ("time", "has no unit")]
)
def test_units_of_time_are_offered_to_choose_from_and_never_taken(heading: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "drift.csv"
    path.write_text(f"{heading},T1 [C],Z [um]\n0,20.1,0.1\n10,20.4,0.1\n20,20.3,0.2\n", encoding="utf-8")
    with pytest.raises(TwoReadingsError, match=message) as caught:
        read_or_offer(path)
    words, toml = offered(caught.value)
    assert words.startswith("choose one, save it as drift.toml")
    assert all(f'# unit = "{unit}"' in toml for unit in ("s", "min"))
    assert run(["map", str(path), "--yes"]) == 2
    seconds = mend(path, "", lambda q: q.options[0] if q.severity == "error" else None).recording.time.tolist()
    assert seconds == [0, 10, 20]
    minutes = mend(path, "", lambda q: q.options[1] if q.severity == "error" else None).recording.time.tolist()
    assert minutes == [0, 600, 1200]


def test_an_offer_goes_on_from_the_mapping_that_was_given(tmp_path: Path) -> None:
    path = tmp_path / "drift.csv"
    path.write_text("time_s,T1,Z\n0,20.1,0.1\n10,20.3\n20,20.3,1.2\n", encoding="utf-8")
    given = tmp_path / "given.toml"
    given.write_text('[columns.front]\ncolumn = "T1"\nrole = "temperature"\nplace = "nose"\n', encoding="utf-8")
    with pytest.raises(RecordingError) as caught:
        read_or_offer(path, read_mapping(given))
    assert offered(caught.value)[1] == (
        '[columns.front]\ncolumn = "T1"\nrole = "temperature"\nplace = "nose"\n\n[read]\nskip = [3]'
    )


def test_nothing_is_offered_where_no_mapping_helps(tmp_path: Path) -> None:
    path = tmp_path / "drift.csv"
    for content in ("", "time_s,t1_C\n", "1,2\n3,4\n"):
        path.write_text(content, encoding="utf-8")
        with pytest.raises(InputError) as caught:
            read_or_offer(path)
        assert not hasattr(caught.value, "__notes__")
    with pytest.raises(InputError, match="no such file"):
        read_or_offer(tmp_path / "none.csv", Mapping())


@pytest.mark.parametrize(
    ("content", "message"),
    [
        # a guess would drop a sensor whose unit is only mistyped
        ("time_s,T1 [degX],Z [um]\n0,20.1,0.1\n10,20.4,0.1\n20,20.3,0.2\n", "degX"),
        ("time_s,T1 [C]\n" + "".join(f"{k},{20 + k}-\n" for k in range(30)), "is not a number"),
        ("time_s,T1 [C]\n" + "".join(f"{30 - k},{20 + k}\n" for k in range(30)), "the newest row comes first"),
        # the temperature rises all the time, and is none
        ("Zeitpunkt im Jahr,Spindel T1\n" + "".join(f"x{k},{20 + k / 9}\n" for k in range(30)), "no time column"),
        ("nr,JD\n" + "".join(f"{k % 3},{2460374.8 + k / 8e9}\n" for k in range(30)), "no time column"),
    ],
)
def test_what_cannot_be_guessed_is_not_offered(content: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "drift.csv"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(InputError, match=message) as caught:
        read_or_offer(path)
    assert not any("this mapping reads it" in note for note in getattr(caught.value, "__notes__", ()))


def test_days_and_stamps_without_signs_are_offered_as_what_they_are(tmp_path: Path) -> None:
    path = tmp_path / "drift.csv"
    for name, cells, keys in (
        ("JD", [2460374.5 + k / 8640 for k in range(50)], 'unit = "d"'),
        ("timestamp", [20240305080000 + 100 * k for k in range(50)], 'format = "%Y%m%d%H%M%S"'),
    ):
        path.write_text(f"{name},T1 [C]\n" + "".join(f"{c!r},20\n" for c in cells), encoding="utf-8")
        with pytest.raises(InputError) as caught:
            read_or_offer(path)
        words, toml = offered(caught.value)
        assert words.startswith("this mapping reads it")
        assert toml == f'[time]\ncolumn = "{name}"\n{keys}'


def test_a_file_that_says_all_needs_no_question(tmp_path: Path) -> None:
    assert mend(written(tmp_path / "drift.csv"), "", lambda q: q.options[0]).text == ""


def test_a_question_is_put_once(tmp_path: Path) -> None:
    asked: list[Question] = []

    def leave(question: Question) -> None:
        asked.append(question)

    mend(written(tmp_path / "drift.csv", step), "", leave)
    assert len(asked) == len({q.text for q in asked}) > 0


# -- the command ---------------------------------------------------------------------------------------------------


def test_the_command_asks_and_writes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "plain.csv"
    path.write_text(
        "time_s,T1,n,Z,q\n" + "".join(f"{10 * k},{20 + k / 10},{k},{k / 1000},{k % 2}\n" for k in range(9)), "utf-8"
    )
    answers = iter(
        ["", "9", 'unit = "banana"', "unit = ", "3", 'role = "displacement", unit = "mm", scale = -1.0', "0"]
    )
    monkeypatch.setattr("builtins.input", lambda: next(answers))
    assert run(["map", str(path), "-o", str(tmp_path / "plain.toml")]) == 0
    said = capsys.readouterr()
    assert "expected a number from 0 to 5" in said.err
    assert "unknown unit 'banana'" in said.err
    mapping = read_mapping(tmp_path / "plain.toml")
    assert {n: (c.role, c.unit, c.scale) for n, c in mapping.columns.items()} == {
        "T1_C": ("temperature", "degC", 1.0),
        "n_um": ("displacement", "um", 1.0),
        "Z_um": ("displacement", "mm", -1.0),
    }
    assert read(path, mapping).table["Z_um"].tolist() == [-float(k) for k in range(9)]
    assert run(["map", str(path), "-o", str(tmp_path / "plain.toml")]) == 2
    assert "exists already" in capsys.readouterr().err


def test_without_an_answer_nothing_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def nobody() -> str:
        raise EOFError

    monkeypatch.setattr("builtins.input", nobody)
    path = written(tmp_path / "drift.csv", spikes)
    assert run(["map", str(path), "-o", str(tmp_path / "drift.toml")]) == 2
    assert "use --yes to accept the best guess" in capsys.readouterr().err
    assert not (tmp_path / "drift.toml").exists()


def test_a_mapping_to_begin_with_is_read_first(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, begun = written(tmp_path / "drift.csv"), tmp_path / "begun.toml"
    for text, reason in (("[read", "not valid TOML"), ("[read]\nskips = [1]\n", "did you mean 'skip'")):
        begun.write_text(text, encoding="utf-8")
        assert run(["map", str(path), "--mapping", str(begun), "--yes"]) == 2
        assert reason in " ".join(capsys.readouterr().err.split())


def test_what_is_left_is_judged_bad(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path / "drift.csv", step)
    assert run(["map", str(path), "--json"]) == 1
    content = json.loads(capsys.readouterr().out)
    assert content["mapping"] == ""
    assert "steps by" in content["left"][0]


# -- from a raw file to a model in two commands -------------------------------------------------------------------


def plant(path: Path, column: str, factor: float, seed: int) -> set[int]:
    """Plant 11 outliers of 1 to 4 mm, alone and adjacent, into a column of a CSV file; return their rows."""
    rng = np.random.default_rng(seed)
    lines = path.read_text(encoding="utf-8").splitlines()
    head = next(k for k, line in enumerate(lines) if not line.startswith("#"))
    where = next(k for k, heading in enumerate(lines[head].split(",")) if heading.split()[0] == column)
    n, rows = len(lines) - head - 1, set[int]()
    for length in (1, 1, 1, 2, 3, 3):
        free = [k for k in range(n - length) if all(abs(k - r) > 16 for r in rows)]
        first = int(rng.choice(free))
        rows |= set(range(first, first + length))
    for row in rows:
        cells = lines[head + 1 + row].split(",")
        cells[where] = f"{float(cells[where]) + rng.choice([-1, 1]) * rng.uniform(1000, 4000) * factor:.0f}"
        lines[head + 1 + row] = ",".join(cells)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return rows


def unseen(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> float:
    assert run([*arguments, "--json", "--jobs", "1"]) in (0, 1)
    return float(json.loads(capsys.readouterr().out)["models"][0]["unseen_rms_um"])


@pytest.mark.parametrize("seed", range(4))
def test_planted_outliers_of_a_printer_are_cut_and_no_other_value(
    seed: int, shared_data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    clean = shared_data / "voron_frame" / "frame_exp_quant_v3_2021-06-13_05-41-53.csv"
    raw, mapping = tmp_path / "raw.csv", str(Path(__file__).parent / "voron.toml")
    raw.write_bytes(clean.read_bytes())
    rows = plant(raw, "mcu_pos_z", 0.4, seed)
    fit = ["--target", "z", "--split", "0.75/0.25", "--model", "ols"]
    rms = unseen(["fit", str(clean), "--mapping", mapping, *fit, "-o", str(tmp_path / "clean.json")], capsys)

    assert run(["map", str(raw), "--mapping", mapping, "--yes", "-o", str(tmp_path / "raw.toml")]) == 0
    said = capsys.readouterr().err
    fitted = ["fit", str(raw), "--mapping", str(tmp_path / "raw.toml"), *fit, "-o", str(tmp_path / "model.json")]
    assert unseen(fitted, capsys) <= 1.05 * rms

    cut = read(raw, read_mapping(tmp_path / "raw.toml"))
    assert set(np.flatnonzero(cut.table["z"].isna())) == rows
    assert "note cut: 11 of 1203 values of z (spike): line " in " ".join(said.split())


@pytest.mark.parametrize("seed", range(4))
def test_planted_outliers_of_the_virtual_machine_are_cut_and_no_other_value(
    seed: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    clean, raw = str(tmp_path / "clean.csv"), tmp_path / "raw.csv"
    assert run(["simulate", "demo", "-o", clean]) == 0
    raw.write_bytes(Path(clean).read_bytes())
    capsys.readouterr()
    rows = plant(raw, "y1_um", 1.0, seed)
    fit = ["--target", "y1_um", "--model", "ols", "--inputs", "t_column_rear_left_C"]
    rms = unseen(["fit", clean, *fit, "-o", str(tmp_path / "clean.json")], capsys)

    assert run(["map", str(raw), "--yes", "-o", str(tmp_path / "raw.toml")]) == 0
    capsys.readouterr()
    fitted = ["fit", str(raw), "--mapping", str(tmp_path / "raw.toml"), *fit, "-o", str(tmp_path / "model.json")]
    assert unseen(fitted, capsys) <= 1.05 * rms

    cut = read(raw, read_mapping(tmp_path / "raw.toml"))
    assert set(np.flatnonzero(cut.table["y1_um"].isna())) == rows
    assert [n for n in cut.notes if n.startswith("cut: 11 of ")]

"""The test vectors of an export notice changes of the code and of its tables, and may be made of a recording."""

import re
import subprocess
from pathlib import Path

import pytest
from smallmachine import small_machine
from watchedmachine import failing, watched_model

from thermocomp.cli.app import run
from thermocomp.core.correction import Limits
from thermocomp.export.c99 import package
from thermocomp.export.facts import Facts
from thermocomp.export.recorded import MOST, find_readings
from thermocomp.export.scenarios import make_readings
from thermocomp.export.vectors import TOLD_COLD, replay
from thermocomp.files import modelfile
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.program.tables import gather
from thermocomp.runtime.watchstate import WORDS

FACTS = Facts("model.json", "0" * 64, "0", "2026-01-01", {})
#: as the page of the package says
SANITIZERS = ("-g", "-fsanitize=address,undefined", "-fno-sanitize-recover")


@pytest.fixture(scope="module")
def compensator() -> Compensator:
    return Compensator.of([watched_model("z_um"), watched_model("x_um")], Limits())


@pytest.fixture(scope="module")
def files(compensator: Compensator) -> dict[str, str]:
    return {name: text.decode() for name, text in package.write_package(compensator, "v", FACTS).items()}


def prove(folder: Path, files: dict[str, str], *flags: str) -> subprocess.CompletedProcess[str]:
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    command = ["gcc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", *flags, "tc_v.c", "tc_v_test.c", "-lm"]
    subprocess.run([*command, "-o", "prove"], cwd=folder, check=True)
    return subprocess.run(["./prove"], cwd=folder, capture_output=True, text=True, check=False, timeout=120)


def test_it_passes_under_sanitizers_as_its_page_says(tmp_path: Path, files: dict[str, str]) -> None:
    assert " ".join(SANITIZERS) in files["tc_v.md"]
    said = prove(tmp_path, files, *SANITIZERS)
    assert (said.returncode, said.stderr) == (0, "")
    assert " 0 wrong" in said.stdout


@pytest.mark.parametrize(
    ("was", "becomes"),
    [
        (r"c_jump_limit\[(\d+)\] = \{\s*TC\(", r"c_jump_limit[\1] = {TC(0.001 + "),  # a number that decides only
        (r"(c_shape\[\d+\]\[\d+\]\[\d+\] = \{(?:[\s{]|/\*.*?\*/)*\(?-?TC\()", r"\g<1>1"),
        (r"c_hold = (\d+)\.0", r"c_hold = \1.1"),
        (r"c_may_lose\[(\d+)\]\[(\d+)\] = \{\s*\{1", r"c_may_lose[\1][\2] = {{0"),
        (r"if \(\(w->both < 0\) \|\| \(rest < w->both_rest\)\)", "if ((w->both < 0) || (rest > w->both_rest))"),
        (r"s->is_back\[i\] = fits;", "s->is_back[i] = !fits;"),
        (r"s->rejected = 3;", "s->rejected = 2;"),
        (r"> c_zero_change\) \|\|", "> 2.0 * c_zero_change) ||"),  # plausibility of a start
        (r"s->outside = s->outside \+ 1", "s->outside = s->outside + 2"),
    ],
)
def test_a_change_is_noticed(tmp_path: Path, files: dict[str, str], was: str, becomes: str) -> None:
    text, changed = re.subn(was, becomes, files["tc_v.c"])
    assert changed, was
    assert prove(tmp_path, files | {"tc_v.c": text}).returncode == 1


def test_a_loop_one_too_far_is_noticed_by_the_sanitizers(tmp_path: Path, files: dict[str, str]) -> None:
    head, body = files["tc_v.c"].split("tc_find_jumps(tc_v_state *s, tc_v_work *w, tc_real elapsed)\n{", 1)
    body = re.sub(r"i < (\d+); i\+\+", lambda m: f"i < {int(m[1]) + 1}; i++", body, count=1)
    assert prove(
        tmp_path,
        files | {"tc_v.c": f"{head}tc_find_jumps(tc_v_state *s, tc_v_work *w, tc_real elapsed)\n{{{body}"},
        *SANITIZERS,
    ).returncode


def test_scenarios_show_every_state(compensator: Compensator) -> None:
    tables = gather(compensator)
    readings = make_readings(tables)
    said = replay(compensator, tables, readings)
    assert len(readings.age) <= 1500
    assert set(said.status.ravel()) == {0, 1, 2, 3, 5}
    assert set(said.why) == {0, 1, 2, 3, 4}
    assert said.warm.any()
    assert said.outside.max() >= 1
    assert set(said.fault.ravel()) >= {WORDS.index(w) for w in ("good", "missing", "stepped", "stuck")}


def test_readings_of_a_recording_follow_those_of_the_scenarios(tmp_path: Path, compensator: Compensator) -> None:
    tables, day = gather(compensator), failing(t1_C=(2.0, None))
    made, both = make_readings(tables), find_readings(tables, day)
    own = slice(len(made.age), None)
    step = -(-len(day) // MOST)
    assert len(both.age) - len(made.age) == -(-len(day) // step)
    assert both.event is not None
    assert both.event[own].tolist().count(TOLD_COLD) == len(day.cycles)
    names = [c.name for c in tables.channels]
    assert both.values[own][5].tolist() == day.table[names].iloc[5 * step].tolist()
    files = package.write_package(compensator, "v", FACTS, day)
    text = {name: t.decode() for name, t in files.items()}
    assert "and readings of failing" in text["tc_v.md"]
    said = prove(tmp_path, text)
    assert f"{len(both.age)} calls, 0 wrong" in said.stdout


def test_vectors_from_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model, day = tmp_path / "model.json", small_machine()
    modelfile.write([watched_model("z_um")], model)
    table = day.to_frame().iloc[:60]
    table.to_csv(tmp_path / "day.csv", index=False)
    line = ["export", str(model), "-o", str(tmp_path / "out"), "--vectors-from"]
    assert run([*line, str(tmp_path / "day.csv"), "--to", "st"]) == 0
    assert "and readings of day" in (tmp_path / "out" / "tc_thermal.md").read_text()
    table.drop(columns="t2_C").to_csv(tmp_path / "less.csv", index=False)
    table.rename(columns={"t2_C": "t2_um"}).to_csv(tmp_path / "other.csv", index=False)
    capsys.readouterr()
    for file in ("less.csv", "other.csv"):
        assert run([*line, str(tmp_path / file), "--to", "c99", "--overwrite"]) == 2
        assert "no column t2_C, an input of the models; it has " in " ".join(capsys.readouterr().err.split())
    assert run([*line, str(tmp_path / "day.csv"), "--to", "siemens", "--axes", "z_um=Z"]) == 2
    assert "--vectors-from: siemens does not support it" in " ".join(capsys.readouterr().err.split())

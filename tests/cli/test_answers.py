"""The answer of a command fits a screen, whatever the command found; the command that it names next runs."""

import io
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from smallmachine import small_machine

from thermocomp.cli import answers, loudness
from thermocomp.cli.answers import fold, free, print_answer
from thermocomp.cli.app import run
from thermocomp.cli.face import CommandFace
from thermocomp.cli.terminal import make_console
from thermocomp.recordings.readers import recordings
from thermocomp.report.answer import CommandAnswer, few
from thermocomp.report.layout import Column, Layout, PrintedLine

FILES = Path(__file__).parents[2] / "docs" / "files"
LINES, ROWS, WIDTH = 12, 25, 80


def check_size(text: str) -> list[str]:
    """Check the size of what a command printed, both streams together; return the words of the next command."""
    lines = [line.rstrip() for line in text.rstrip("\n").split("\n")]
    assert max(map(len, lines)) <= WIDTH, text
    rules = [k for k, line in enumerate(lines) if line and not line.strip("─ ")]
    assert len(rules) <= 1, text
    for rule in rules:
        begin = max(k for k in range(rule) if not lines[k]) + 1
        end = next(k for k in range(rule, len(lines)) if not lines[k])
        assert rule - begin <= 4, text
        assert 0 < end - rule - 1 <= ROWS, text
        heading, first = " ".join(lines[begin:rule]), lines[rule + 1]
        if re.search(r"RMS|instead|largest|range|gain|leans", heading):
            assert re.search(r"\b(um|urad|unit)\b", heading) or re.search(r"\[(um|urad)\]", first), text
        del lines[begin:end]
    assert len([line for line in lines if line]) <= LINES, text
    _, _, following = "\n".join(lines).partition("\nNext:")
    return shlex.split(following.replace("\\\n", " "))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sound recording, one with several faults, one of another day, and the files of the docs."""
    path = tmp_path_factory.mktemp("answers")
    shutil.copytree(FILES, path, dirs_exist_ok=True)
    sound, faulty = small_machine(dt=200.0), small_machine(dt=200.0)
    faulty.table.loc[:, "t2_C"] = -180.0
    faulty.table.loc[100:103, "z_um"] += 60.0
    faulty.table.loc[150:, "x_um"] += 50.0
    recordings.write(sound, path / "drift.csv", overwrite=True)
    recordings.write(faulty, path / "faulty.csv")
    recordings.write(small_machine((2200.0, 1200.0), seed=3, dt=200.0), path / "other.csv")
    return path


#: command lines in turn: later ones read what earlier ones have written
LINES_OF = [
    "simulate hwang -o hwang.csv",
    "simulate --list",
    "check drift.csv",
    "check faulty.csv",
    "check drift.csv other.csv hwang.csv faulty.csv",
    "compare drift.csv --models ols dynamic --jobs 1 -o page.html",
    "compare faulty.csv --models ols --jobs 1",
    "fit drift.csv --model ols --jobs 1 -o ols.json",
    "explain ols.json",
    "assess ols.json other.csv",
    "assess ols.json drift.csv",
    "select drift.csv --models ols --max-sensors 2 --jobs 1",
    "select drift.csv --method grouping --jobs 1",
    "plan drift.csv --no-curve --jobs 1",
    "plan drift.csv --running",
    "position laser_y.csv --component EYY --model mra",
    "position laser_y.csv --component EYY --model mra -o eyy.json",
    "volumetric mill_y.toml --recording laser_y.csv --at 500 450 100",
    "volumetric mill.toml",
    "iso230 drift.csv",
    "iso230 --positioning positioning.csv",
    "revise plate.ngc --model spindle.json --cold --unproved --controller linuxcnc "
    "--origin 'G54=200 mm, 150 mm, 100 mm' --tool '1=120 mm' '2=140 mm' '3=160 mm' -o revised.ngc",
]


@pytest.mark.parametrize("line", LINES_OF)
def test_every_command_fits_a_screen_and_names_a_command_that_runs(
    line: str, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    assert run(shlex.split(line)) in (0, 1)
    said = capsys.readouterr()
    following = check_size(said.err + said.out)
    last = any(word in line for word in ("--running", "revise", "eyy.json"))
    assert bool(following) == (not last), said.out
    if following:
        assert following[0] == "thermocomp"
        asks = ["--yes"] if following[1] == "map" else []
        assert run([*following[1:], *asks]) in (0, 1)
        said = capsys.readouterr()
        if following[1] not in ("map", "export"):
            check_size(said.err + said.out)


def test_details_follow_the_answer(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    run(["check", "drift.csv"])
    short = capsys.readouterr().out
    run(["check", "drift.csv", "--details"])
    answer, _, more = capsys.readouterr().out.partition("\n\ndrift.csv: ")
    assert answer.replace("\nNext", "\n--details prints all results.\nNext") in short
    assert "t1_C" in more
    assert "t1_C" not in short
    run(["check", "drift.csv"])
    assert capsys.readouterr().out == short  # for one command line only


def test_the_next_command_has_the_options_given(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    given = ["drift.csv", "--target", "z_um", "--absolute", "--start", "cold", "--magnitude", "300", "--jobs", "1"]
    run(["compare", *given, "--models", "ols"])
    following = check_size(capsys.readouterr().out)
    assert following[:3] == ["thermocomp", "fit", "drift.csv"]
    found = [following[k : k + 2] for k, word in enumerate(following) if word.startswith("-")]
    wanted = [["--target", "z_um"], ["--start", "cold"], ["--magnitude", "300.0"], ["--jobs", "1"]]
    assert all(pair in found for pair in wanted), following
    assert "--absolute" in following
    assert "--models" not in following


def shown(answer: CommandAnswer, width: int = WIDTH) -> str:
    """Return what is printed of an answer."""
    file = io.StringIO()
    print_answer(answer, make_console(file=file, width=width))
    return file.getvalue()


def test_an_answer_of_any_size_fits() -> None:
    names = [f"t_spindle_housing_front_{k}_C" for k in range(60)]
    sentence = " ".join(f"word{k}" for k in range(100))
    columns = (Column("target", 0), Column("long heading of numbers", 1, ".2f"), Column("what", 2), Column("two", 3))
    answer = CommandAnswer(
        head=sentence,
        table=Layout(columns, [(n, 1234.5678, sentence[:60], "two words") for n in names]),
        lines=[PrintedLine(sentence), PrintedLine(f"Sensors: {few(names)}.")],
        warnings=[sentence, *names],
        files=["a.csv"],
        following=("thermocomp", "compare", "a file.csv", "--target", "x_um", "y_um", "--inputs", *names[:2]),
    )
    text = shown(answer)
    assert check_size(text) == list(answer.following)
    told = re.search(r"--details prints (\d+) more rows and 60 more warnings and all results", text)
    assert told is not None
    rows = [line for line in text.split("\n") if line.startswith("t_spindle_housing_front...")]
    assert int(told[1]) == len(names) - len(rows)
    assert few(names[:4]) == f"{', '.join(names[:3])} and 1 more"
    words = set(sentence.split()) | {"..."}
    assert set(text.split("\n\n")[0].split()) <= words


@pytest.mark.parametrize("cells", [("a b", "x" * 70), ("n" * 200, "m" * 200), ("two words " * 30, "1")])
def test_cells_keep_to_the_width_and_words_stay_whole(cells: tuple[str, str]) -> None:
    text = shown(CommandAnswer(head="head", table=Layout((Column("first", 0), Column("second", 1)), [cells])))
    check_size(text)
    whole = [word for cell in cells for word in cell.split() if len(word) <= answers.WORD]
    assert all(word in text.split() for word in whole)


def test_a_part_of_an_answer_counts_its_other_warnings(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """`demo` prints the answer of `compare` as a part of its own, without its hint."""
    monkeypatch.setattr(loudness, "details", False)
    for warnings in (["a"], ["word " * 60, "b", "c"]):
        made = CommandAnswer(head="Done.", warnings=warnings)
        CommandFace(part=True).answer(dict, lambda made=made: made, lambda: None)  # type: ignore[misc]
    first, second = capsys.readouterr().out.split("Done.")[1:]
    assert first.split() == ["Warning:", "a"]
    assert " ".join(second.split()).endswith("word ... (2 more: --details)")
    check_size(second)


def test_text_that_is_cut_says_so() -> None:
    assert fold("one two three", 1, 20, " (more)") == ["one two three (more)"]
    assert fold("one two three four", 1, 20, " (more)") == ["one two ... (more)"]
    assert fold("one two three four " * 20, 1, 20, " (more)") == ["one two ... (more)"]
    assert fold("one two three", 2, 8) == ["one two", "three"]


def test_a_file_that_exists_is_not_proposed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert free("model.json") == Path("model.json")
    for name in ("model.json", "model-2.json"):
        Path(name).touch()
    assert free("model.json") == Path("model-3.json")


@pytest.mark.long
@pytest.mark.parametrize("experiment", ["demo", "fl_thermal"])
def test_in_a_pipe_on_whole_recordings(experiment: str, tmp_path: Path, shared_data: Path) -> None:
    def printed(*words: str) -> list[str]:
        code = "from thermocomp.cli.app import main; main()"
        done = subprocess.run(
            [sys.executable, "-c", code, *words],
            cwd=tmp_path,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            check=False,
        )
        assert done.returncode in (0, 1), done.stdout
        return check_size(done.stdout.decode())

    if experiment == "demo":
        following = printed("demo", "-o", "demo")
        assert following[1] == "explain"
        recording = "demo/recording.parquet"
    else:
        shutil.copy(shared_data / "fl_thermal" / "recording.csv", tmp_path / "recording.csv")
        recording = "recording.csv"
    compare = printed("check", recording)
    assert compare[1] == "compare"
    fit = printed(*compare[1:])
    assert fit[1] == "fit"
    explain = printed(*fit[1:])
    assert explain[1] == "explain"
    export = printed(*explain[1:])
    assert export[1] == "export"
    printed(*export[1:])
    printed("simulate", "random", "-o", "random.parquet")
    if experiment == "demo":
        printed("assess", "model.json", "random.parquet")
    assert printed("select", recording)[1] == "compare"
    assert printed("plan", recording)[1] == "plan"

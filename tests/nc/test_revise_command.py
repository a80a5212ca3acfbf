"""``thermocomp revise``: programs in, programs out."""

import json
import shutil
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import pytest
from driftmodels import lags
from reviseruns import HONEST, PLATE, judged, revise, said, table, without_header, write_models

from thermocomp.nc.revision import jobstate
from thermocomp.nc.rewrite.header import MARK

# -- what is written -------------------------------------------------------------------------------------------------


def test_the_files_of_a_run(job_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert revise("--date", "2026-01-31") == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "part.ngc: 23 lines" in text
    assert "spindle 4000 to 6000 1/min; 2 tool changes" in text
    assert (
        "Start: cold, drift relative to the start of the program; method coordinates, updated per 1 um of drift" in text
    )
    assert "but the models use the spindle speed alone" in text
    assert "but no interpreter has verified it (--unproved); assumed: no stored rotation (--rotation), no G92" in text
    assert "but no picture was drawn: matplotlib is not installed" in text
    assert "note no --machine: the times are those of a medium machining centre" in text
    expected = {"model.json", "part.ngc", "out.ngc", "out.ngc.diff", "out.ngc.csv", "out.ngc.job.json"}
    assert {p.name for p in job_folder.iterdir()} == expected
    assert Path("part.ngc").read_text(encoding="ascii") == PLATE
    lines = Path("out.ngc").read_text(encoding="ascii").splitlines()
    assert lines[0] == "%"
    header = [line for line in lines if MARK in line]
    assert lines[1 : 1 + len(header)] == header
    assert all(line.startswith(f"({MARK} ") and line.endswith(")") and len(line) <= 80 for line in header)
    assert header[-1] == f"({MARK} UNPROVED: NO INTERPRETER HAS VERIFIED IT)"
    assert "DO NOT REVISE AGAIN" in header[0]
    assert "2026-01-31, for linuxcnc" in header[1]
    assert any("model model.json " in line and line.endswith(" for Z)") for line in header)
    assert any(line.endswith(" start cold)") for line in header)
    assert any(line.endswith(" drift relative to the start of the program)") for line in header)
    assert any("bound, as assumed: Z" in line and " um" in line for line in header)


def test_nothing_of_the_header_is_cut(job_folder: Path) -> None:
    for k, axis in enumerate("xyz"):
        write_models([judged(lags(f"{axis}_um", 0.1 * (k + 1)))], f"{axis}.json")
    models = ["--model", "x.json", "y.json", "z.json"]
    assert revise(*models, "--rotation", "none") == 0
    later = ["--pause", "2 days", "--every", "10 min", "--date", "2026-01-31"]
    assert revise(*models, "--carried", "out.ngc.job.json", *later, "--rotation", "none", out="next.ngc", start="") == 0
    header = [line for line in Path("next.ngc").read_text(encoding="ascii").splitlines() if MARK in line]
    assert [line.removeprefix(f"({MARK} ").split()[0] for line in header] == (
        [
            "REVISED",
            "thermocomp",
            "program",
            "model",
            "model",
            "start",
            "drift",
            "method",
            "bound,",
            "stop:",
            "tool",
            "feed",
            "UNPROVED:",
        ]
    )
    assert header[5].endswith("start 2 days after out.ngc.job.json)")
    assert header[6].endswith("relative to the zero of the last job)")
    assert header[7].endswith("steps 1 um)")
    assert all(f"{axis} " in header[8] for axis in "XYZ")
    assert header[8].endswith(" um)")


def test_the_same_run_writes_the_same_bytes(job_folder: Path) -> None:
    assert revise("--date", "2026-01-31") == 0
    first = {p.name: p.read_bytes() for p in job_folder.iterdir()}
    assert revise("--date", "2026-01-31", "--overwrite") == 0
    assert {p.name: p.read_bytes() for p in job_folder.iterdir()} == first


def test_the_table_follows_the_lines(job_folder: Path) -> None:
    assert revise() == 0
    rows = table()
    original = PLATE.splitlines()
    revised = Path("out.ngc").read_text(encoding="ascii").splitlines()
    assert [int(r["line"]) for r in rows] == list(range(1, len(original) + 1))
    for row in rows:
        was, now = original[int(row["line"]) - 1], revised[int(row["revised_line"]) - 1]
        assert (was != now) == (row["changed"] == "1")
    assert float(rows[-1]["end_s"]) > 1800
    assert all(float(a["end_s"]) == float(b["start_s"]) for a, b in pairwise(rows))
    drift = [float(r["drift_z_um"]) for r in rows]
    assert max(drift) > 10
    # the hole behind the tool change carries minus the drift, rounded up to the tolerance
    hole = original.index("G81 X10 Y10 Z-5 R2 F40")
    carried = float(rows[hole]["correction_z_um"])
    assert carried == pytest.approx(-drift[hole], abs=1.0)
    assert f"Z{-5 + carried / 1e3:.4f}" in revised[int(rows[hole]["revised_line"]) - 1]


@pytest.mark.skipif(shutil.which("patch") is None, reason="the tool patch is not installed")
@pytest.mark.parametrize("ending", ["\n", "\r\n"])
@pytest.mark.parametrize("last", ["", "(no end of line)"])
def test_the_diff_makes_the_revised_program(job_folder: Path, ending: str, last: str) -> None:
    Path("part.ngc").write_bytes((PLATE + last).replace("\n", ending).encode("ascii"))
    assert revise() == 0
    difference = Path("out.ngc.diff").read_bytes()
    assert f"+({MARK} REVISED".encode() in difference
    assert f"({MARK} 0)".encode() not in difference + Path("out.ngc").read_bytes()
    shutil.copy("part.ngc", "patched.ngc")
    with Path("out.ngc.diff").open("rb") as given:
        subprocess.run(["patch", "--binary", "-s", "-F0", "patched.ngc"], stdin=given, check=True)
    assert Path("patched.ngc").read_bytes() == Path("out.ngc").read_bytes()
    written = Path("out.ngc").read_bytes()
    plus, minus = (sum(line.startswith(mark) for line in difference.split(b"\n")[2:]) for mark in (b"+", b"-"))
    assert written.count(b"\n") == (PLATE + last).count("\n") + plus - minus
    assert written.count(ending.encode()) == written.count(b"\n")


def test_bytes_that_are_no_ascii_come_through(job_folder: Path) -> None:
    before, after = PLATE.encode().split(b"(a plate)")
    Path("part.ngc").write_bytes(before + b"(Platte f\xfcr M\xc3\xbcller \xff)" + after)
    assert revise() == 0
    assert b"(Platte f\xfcr M\xc3\xbcller \xff)\n" in Path("out.ngc").read_bytes()


def test_the_offset_method_leaves_the_words_alone(job_folder: Path) -> None:
    assert revise("--method", "offset", "--no-g92", "--safe-z", "20 mm") == 0
    lines = without_header("out.ngc").decode().splitlines()
    offsets = [line for line in lines if line.startswith("G90 G52")]
    assert [line for line in lines if not line.startswith("G90 G52")] == PLATE.splitlines()
    assert len(offsets) >= 2
    assert offsets[0] == "G90 G52 Z0.0"  # an aborted run may have left another one in force
    assert all("Z-" in line and "X" not in line for line in offsets[1:-1])
    assert offsets[-1] == "G90 G52 Z0.0"


def test_numbers_for_programs(job_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_models([judged(lags("x_um", -0.5)), judged(lags("z_um"))], "two.json")
    assert revise("--model", "two.json", "--json", "--every", "5 min", "--rotation", "none") == 0
    told = json.loads(capsys.readouterr().out)
    assert told["lines"] == 23
    assert told["files"]["program"] == "out.ngc"
    assert told["files"]["picture"] is None
    assert told["spindle_1_per_min"] == [4000, 6000]
    assert len(told["tool_changes_s"]) == 2
    x, z = told["axes"]
    assert (x["axis"], z["axis"]) == ("X", "Z")
    assert z["drift_high_um"] > 0 > x["drift_low_um"]
    for axis in (x, z):
        assert axis["model_um"] == HONEST.max_abs
        assert axis["bound_um"] == pytest.approx(axis["left_um"] + HONEST.max_abs)
        assert axis["left_um"] <= axis["without_um"]
    assert told["run_time_s"] == pytest.approx(float(table()[-1]["end_s"]), abs=1e-3)
    assert told["proof"] is None
    assert told["us_per_line"] > 0


def test_the_picture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    write_models([judged(lags("z_um"))], "model.json")
    Path("part.ngc").write_text(PLATE, encoding="ascii")
    assert revise() == 0
    assert Path("out.ngc.png").read_bytes().startswith(b"\x89PNG")
    assert "out.ngc.png" in capsys.readouterr().out


# -- the state at the start ------------------------------------------------------------------------------------------


def test_a_job_begins_where_the_last_one_ended(job_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert revise("--date", "2026-01-31") == 0
    saved = jobstate.read("out.ngc.job.json")
    assert saved.written.isoformat()[:4] == "2026"
    ended = float(table()[-1]["drift_z_um"])
    capsys.readouterr()
    assert revise("--carried", "out.ngc.job.json", out="next.ngc", start="") == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "state of out.ngc.job.json, drift relative to the zero of the last job" in text
    rows = table("next.ngc.csv")
    assert float(rows[0]["drift_z_um"]) == pytest.approx(ended, abs=0.01)
    # the first word already carries the drift that the last job has left
    first = next(r for r in rows if r["changed"] == "1")
    assert float(first["correction_z_um"]) == pytest.approx(-float(first["drift_z_um"]), abs=1.0)
    assert revise("--carried", "out.ngc.job.json", "--pause", "8 h", out="late.ngc", start="") == 0
    assert float(table("late.ngc.csv")[0]["drift_z_um"]) == pytest.approx(0.0, abs=0.1)
    header = Path("late.ngc").read_text(encoding="ascii").splitlines()
    assert f"({MARK} start 8 h after out.ngc.job.json)" in header
    assert f"({MARK} drift relative to the zero of the last job)" in header
    assert revise("--carried", "out.ngc.job.json", "--zero", "start", out="again.ngc", start="") == 0
    assert float(table("again.ngc.csv")[0]["drift_z_um"]) == 0.0


def test_a_measured_start(job_folder: Path) -> None:
    assert revise("--measured", "z=12um", start="") == 0
    assert float(table()[0]["drift_z_um"]) == pytest.approx(12.0, abs=1e-3)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ([], "machine is not stated: give one of --cold, --carried JOB.json and --measured"),
        (["--cold", "--measured", "z=12um"], "machine is stated 2 times"),
        (["--cold", "--pause", "3 min"], "--pause is the time since the last job"),
        (["--carried", "gone.json"], "gone.json: no such state file of a job"),
        (["--carried", "model.json"], "model.json: not a state file of a job"),
        (["--measured", "z=12"], "expected an axis or target, and a value with its unit"),
        (["--cold", "--zero", "last"], "requires the state carried over"),
    ],
)
def test_the_start_has_to_be_stated(
    job_folder: Path, options: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    before = set(job_folder.iterdir())
    assert revise(*options, start="") == 2
    assert message in said(capsys)
    assert set(job_folder.iterdir()) == before


def test_it_runs_beside_a_controller(job_folder: Path) -> None:
    """In a Python that cannot see the extras of the training wing."""
    blocked = "import sys\nfor m in ('pandas', 'sklearn', 'scipy', 'joblib', 'matplotlib'): sys.modules[m] = None\n"
    code = blocked + "from thermocomp.cli.app import run\nsys.exit(run(sys.argv[1:]))"
    command = [sys.executable, "-c", code, "revise", "part.ngc", "--model", "model.json", "--cold", "-o", "out.ngc"]
    done = subprocess.run(
        [*command, "--unproved", "--controller", "linuxcnc", "--details"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "no picture was drawn" in " ".join(done.stdout.split())
    assert Path("out.ngc").exists()
    assert not Path("out.ngc.png").exists()

"""The bound states its conditions: what other stops, feeds and initial states are worth, against true runs."""

import json
import math
from pathlib import Path

import pytest
from nc_conditions import largest, table
from nc_law import STATED, Growing, Trial, revise
from reviseruns import revise as command
from reviseruns import said

from thermocomp.nc.interpreter.block import Point
from thermocomp.nc.revision.values import percent_of, spread_of
from thermocomp.nc.rewrite.header import MARK
from thermocomp.nc.rewrite.text import Vector

BEGIN = "G21 G90 G17 G94\nS3000 M3 F300\nG0 X0 Y0 Z10\n"
QUICK = (("as assumed", 0.0), ("stop", 1200.0), ("tool change", 40.0), ("feed", 0.8), ("feed", 1.2), ("start", 0.0))


def test_true_runs_stay_within_the_printed_range(tmp_path: Path) -> None:
    """Another seed than the benchmark's; the plant is exactly linear, so that only the conditions matter."""
    rows = table(41, tmp_path, QUICK, unproved=True)
    assert [row for row in rows if row.error > row.printed] == []
    worst = largest(rows)
    assert {row.kind for row in worst if row.more > 2.0} >= {"stop", "start"}
    assert [row for row in worst if row.more > 1.0 and row.adds > 1.5 * row.more] == []


def program(text: str, **options: str) -> list[str]:
    Path("part.ngc").write_text(f"G21 G90 G17 G94 G54\nS6000 M3\n{text}M2\n", encoding="ascii")
    words = [w for name, value in options.items() for w in (f"--{name.replace('_', '-')}", value)]
    assert command("--overwrite", *words) == 0
    return Path("out.ngc").read_text(encoding="ascii").splitlines()


HOT = "G0 X0 Y0 Z5\nG1 Z-1 F300\n" + "X50 F60\nX0\n" * 15 + "G0 Z50\n"


def test_header_and_output_state_what_was_assumed(job_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    header = [line for line in program(f"{HOT}M5\nM0\nS6000 M3\n{HOT}") if MARK in line]
    text = " ".join(capsys.readouterr().out.split())
    for name, start in (("stop x1 as 60 s", "0 s to 20 min"), ("feed as 100", "80"), ("start as cold", "10 min after")):
        (line,) = (line for line in header if name in line)
        assert f": {start}" in line
        assert line.endswith(" um)")
        assert f"Bound: {name}" in text
    assert any("tool change: none" in line for line in header)
    assert "Bound: tool change" not in text


def test_a_single_value_is_certain(job_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    told = {"stop": "2 min", "tool_change": "9 s", "override": "90 %"}
    header = program(f"{HOT}M0\nT1 M6\nS6000 M3\n{HOT}", **told)
    assert any(line.endswith("stop x1 as 2 min)") for line in header)
    capsys.readouterr()
    assert command("--overwrite", "--json", "--stop", "2 min", "--override", "90 %") == 0
    found = {c["kind"]: c for c in json.loads(capsys.readouterr().out)["conditions"]}
    assert [found[kind]["others"] for kind in ("stop", "feed")] == [[], []]
    assert len(found["tool change"]["others"]) == 2


@pytest.mark.parametrize("wrong", ["60 s, 2 min to 3 min", "60 s, 90 s to 20 s", "60 s to 2 min", "60", ""])
def test_ranges_that_make_no_sense_are_refused(
    wrong: str, job_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert command("--stop", wrong) == 2
    assert "--stop" in said(capsys)


def test_a_range_is_read() -> None:
    found = spread_of("100 %, 80 % to 120.5%", percent_of, "--override", "100 %")
    assert found == ("100 %", 1.0, (("80 %", 0.8), ("120.5%", 1.205)))


def test_a_stop_that_matters_tells_the_operator(job_folder: Path) -> None:
    lines = program(f"{HOT}M5\nM0\nS6000 M3\n{HOT}M5\nM0\n", stop_limit="1 um")
    at = [k for k, line in enumerate(lines) if line == "M0"]
    assert all(lines[k - 1].startswith("(MSG, DRIFT IN THIS STOP") for k in at)
    words = lines[at[0] - 1].split()
    shortest, longest = (float(words[words.index(w) + 2]) for w in ("SHORTER", "LONGER"))
    assert 0.0 < shortest < 60.0 < longest < 1200.0
    assert not any("MSG" in line for line in program(f"{HOT}M5\nM0\nS6000 M3\n{HOT}", stop_limit="300 um"))


def test_messages_need_a_range(job_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert command("--stop", "60 s", "--stop-limit", "5 um") == 2
    assert "--stop-limit requires a range of stops" in said(capsys)


class Ending(Growing):
    """A drift that comes to an end, fast at first."""

    def deviation(self, point: Point) -> Vector:
        return 0.0, 0.0, 60.0 * (1.0 - math.exp(-self.time / 600.0))


class Sideways(Ending):
    """The same along X."""

    def deviation(self, point: Point) -> Vector:
        return super().deviation(point)[::-1]


def cut(folder: Path, text: str, top: float | None = None, drift: Growing | None = None) -> Trial:
    path = folder / "program.ngc"
    path.write_text(f"{BEGIN}{text}M2\n", encoding="ascii")
    return revise(path, folder, drift or Ending(), "coordinates", setup=STATED, split=False, stock_top=top)


def test_the_plunge_above_the_stock_does_not_count(tmp_path: Path) -> None:
    """8 mm of 10 are in the air, where the correction still follows; 2 mm are in the stock."""
    plunge = "G4 P600\nG1 Z0 F1\nG0 Z10\n"
    counted, free = cut(tmp_path, plunge), cut(tmp_path, plunge, 2.0)
    assert counted.run.left.most[2] > 30.0
    assert free.run.left.most[2] < 0.5 * counted.run.left.most[2]
    above = cut(tmp_path, "G1 Z8\nX90 F20\nG0 Z10\n", 2.0)
    assert above.run.left.most == [0.0] * 3
    unknown = cut(tmp_path, f"T2 M6\n{plunge}", 2.0)
    assert unknown.run.left.most[2] == pytest.approx(cut(tmp_path, f"T2 M6\n{plunge}").run.left.most[2])


@pytest.mark.parametrize(
    ("text", "most"),
    [
        ("G4 P900\nG10 L2 P1 X0 Y0 Z0\nG53 G0 Z-1\nG1 Z-1.2\nX9\n", 2.0),  # 0.2 mm cannot take up 40 um
        ("G4 P900\nG10 L2 P1 X0 Y0 Z0\nG53 G0 Z10\nG1 Z-1\nX9\n", 60.0),  # an approach of 11 mm can
    ],
)
def test_a_short_feed_move_after_machine_coordinates_takes_a_step(text: str, most: float, tmp_path: Path) -> None:
    trial = cut(tmp_path, f"G54\n{text}G0 Z10\n")
    trial.proved()
    taken = [row.carried[2] for row in trial.rows if row.text.startswith("G1 Z")]
    assert abs(taken[0]) <= most
    assert (most > 2.0) == (abs(taken[0]) > 30.0)


def test_a_cut_after_machine_coordinates_at_depth_takes_steps(tmp_path: Path) -> None:
    text = "G54\nG10 L2 P1 X0 Y0 Z0\nG1 Z-1\nX10\nG4 P900\nG53 G1 X20\nX40\nX60\nG0 Z10\nX0\n"
    trial = cut(tmp_path, text, drift=Sideways())
    trial.proved()
    taken = {row.number: row.carried[0] for row in trial.rows}
    assert taken[9] == 0.0
    assert 0.0 < -taken[10] <= 2.0 + 1e-6
    assert -taken[13] > 30.0


def test_the_top_of_the_stock_holds_in_the_other_runs(job_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A slow plunge after the stop: the drift changes while the tool is in the air."""
    left = []
    for more in ([], ["--stock-top", "0 mm"]):
        program(f"{HOT}M5\nM0\nS6000 M3\nG0 X0 Y0 Z20\nG1 Z-0.1 F1\nG0 Z50\n")
        capsys.readouterr()
        assert command("--overwrite", "--json", *more) == 0
        stop = next(c for c in json.loads(capsys.readouterr().out)["conditions"] if c["kind"] == "stop")
        left.append(max(other["left_um"]["z"] for other in stop["others"]))
    assert left[1] < 0.8 * left[0]

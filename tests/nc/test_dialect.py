"""Whose program it is: judged from the whole of it, and asked for where a word is read in two ways."""

from pathlib import Path
from typing import Any

import pytest
from nc_interpreter import PROGRAMS, needs_programs

from thermocomp.core.exceptions import ProgramError
from thermocomp.nc.interpreter.dialect import check_dialect
from thermocomp.nc.parser.tokens import split_lines

FANUC = sorted((Path(__file__).parent / "fanuc").glob("*.nc"))
#: what both read in the same way
BEGIN, END = "G21 G90 G17\nS3000 M3\nG0 X0 Y0 Z5.\nG1 X-1. F100\n", "X0\nG0 Z5.\nM30\n"


def question(text: str, **stated: Any) -> str:
    """Return what is asked of a program; empty if nothing is."""
    try:
        check_dialect(split_lines(text), **stated)
    except ProgramError as error:
        return str(error)
    return ""


@pytest.mark.parametrize(
    "text",
    [
        "X100. F50",
        "G4 P0.5\nG4 P1.25\nG4 P0",
        "G98 G81 X1. Y2. Z-1. R1. F50\nX3.\nG80",
        "G43 H1 Z5.",
        "G10 L2 P1 X5. Y0",
        "G53 G0 Z0\nG1",
        "G2 X10. Y0 I5. J0",
        "#1=5.\nX#1 Y[#1+2.]",
        "(O1000, X100, G4 P500)",
        "G64\nT1 M6",
        "G28 Z0\nG30 X0",
        ";\nX1.;",
        "F200",
        "G98\nG99\nG81 X1. Z-1. R1.\nG80",
        "G98",
        "T1001 M6",
        "T0202\nM6",
        "T12",
        "G18\nG90 X1. Y0 Z2.\nG90 G0 X1. Z2.\nG17",
        "G90 X1. Z2.",
        "#1=#100\nX[#1+#999]",
        "G95 F0.2",
        "M19\nM3",
        "G91 G28 Z0\nG90",
        "G98 G82 X1. Z-1. R1. P0\nX2.\nG82 X3.\nG80",
        "G2 X10. Y0 I5. J0 P1",
        "G18 G8\nG17",
        "#1=ACOS[-0.5]\nX#1",
        "G42 D1 X1.\nG40",
        "G18 G98\nG17 G81 X1. Y2. Z-1. R1.\nG80\nG19\nG17",
        "G98 G81 X1. Y2. Z-1. R1.\nG91 G81 X1. Z-2. R-1.\nX3.\nG80 G90",
        "G98 G81 X1. Y2. Z-1. R1.\nG80\nG91 X1.\nG90",
    ],
)
def test_what_both_read_alike_is_not_asked_for(text: str) -> None:
    assert question(f"{BEGIN}{text}\n{END}") == ""


@pytest.mark.parametrize(
    ("text", "asked"),
    [
        (
            "G04P500",
            "G4 P500 is 500 s for LinuxCNC, and 0.5 s for a Fanuc: give --controller, or for a Fanuc write G4 X, which",
        ),
        ("G4 P500.", "G4 P500. is 500 s for LinuxCNC and a Haas, a Fanuc expects milliseconds without a decimal point"),
        ("G98 G82 X1. Z-1. R1. P2.", "G82 P2. is 2 s for LinuxCNC and a Haas"),
        ("g4 p [#1*2]", "G4 P[..] is in seconds for LinuxCNC"),
        (
            "X 1 0 0",
            "X100 is 100 mm for LinuxCNC, and 0.1 mm for a Fanuc that uses least increments: write the decimal point",
        ),
        ("G20\nY-2", "Y-2 is -2 in for LinuxCNC, and -0.0002 in"),
        ("A90", "A90 is 90 deg for LinuxCNC, and 0.09 deg"),
        ("G2 X10. I5", "I5 is 5 mm"),
        ("G98 G81 X1. Z-5 R1.", "Z-5 is -5 mm"),
        ("G98 G82 X1. Z-1. R1. P500", "G82 P500 is 500 s for LinuxCNC, and 0.5 s"),
        ("G81 X1. Z-1. R1.", "G81 before G98 or G99 returns to R in LinuxCNC (G99)"),
        ("G98 G81 X1. Z-1. R1. L3", "G81 L3 repeats"),
        ("G0 Z2.\nG98 G81 X1. Z-5. R10. F100.", "G81 R10. is above the level at which the cycle begins"),
        ("G0 Z2.\nG91 G99 G81 X1. Z-5. R0.5 F100.", "G81 R0.5 is above the level at which the cycle begins"),
        ("G0 Z5.\nG91 G0 Z-3.\nG90\nG98 G81 X1. Z-5. R3. F100.", "G81 R3. is above the level"),
        ("G0 Z5.\nG99 G81 X1. Z-5. R1. F100.\nG80\nX2.\nG99 G81 X1. Z-5. R2.", "G81 R2. is above the level"),
        ("G98 G81 X1. Z-1. R1.\nX2. K3", "G81 K3 repeats"),
        ("G98 G83 X1. Z-1. R1. Q1.", "G83 stops 0.254 mm above the last depth"),
        ("G99 G84 X1. Z-1. R1.", "G84 needs a turning spindle"),
        ("G76 X1. Z-1. R1.", "G76 is a different cycle"),
        ("G92 X0", "G92 shares one store"),
        ("G52 X1.", "G52 shares one store"),
        ("G10 L20 P1 X0", "G10 L20 P1 sets other offsets"),
        ("G10 L2 P0 X1.", "G10 L2 P0 sets other offsets"),
        ("G91 G10 L2 P1 X1.\nG90", "G10 L2 P1 sets other offsets"),
        ("G53 Z0", "G53 moves at feed rate in LinuxCNC under G1"),
        ("G43", "G43 without H uses the tool in the spindle"),
        ("G61", "G61 follows corners exactly"),
        ("G61.1", "G61.1 stops in corners"),
        ("U5.", "U5. is a separate axis"),
        ("M98 P1000", "M98 is read by LinuxCNC from separate files"),
        ("X[#1 AND 3]", "AND, OR or XOR works on bits"),
        ("G10 L2 P1 X1. R5.", "G10 L2 P1 sets other offsets"),
        ("G#1 P500", "G#1 is computed at run time"),
        ("G [4] P500", "G[..] is computed at run time"),
        ("M#2", "M#2 is computed"),
        ("G4 P1. X5.", "X5. with G4 moves in LinuxCNC"),
        ("G4 P0 A5.", "A5. with G4 moves"),
        ("G99", "G99 without cycles is feed per turn"),
        ("T0202", "T0202 without M6 changes the tool"),
        ("G18 G90 X4. Z-3. F0.2", "G90 with X and Z is a turning cycle"),
        ("G96 S200\nG94 X4. Z-3. F0.2", "G94 with X and Z is a turning cycle"),
        ("G95 F1", "F1 is 1 mm per turn in LinuxCNC, perhaps in least increments"),
        ("G20\nF10", "F10 is 10 in per minute in LinuxCNC"),
        ("X[FIX[#1/2]]", "FIX, FUP, MOD or ROUND rounds differently"),
        ("X[#1 MOD 3]", "FIX, FUP, MOD or ROUND"),
        (
            "#101=ASIN[-0.5]",
            "ASIN or ATAN below zero is a negative angle in LinuxCNC, and may be 360 degrees more in a Fanuc",
        ),
        ("#101 = atan [-1.] / [1.]", "ASIN or ATAN below zero"),
        ("X[2.*asin[#1]]", "ASIN or ATAN below zero"),
        ("X#5221", "#5221 from #1000 on has different meanings"),
        ("# 3001 = 0", "#3001 from #1000 on"),
        ("X#[#1+5000]", "#[..] from #1000 on"),
        ("X##1", "##1 from #1000 on"),
        ("X1. ; G4 P1", "';G4P1' is a comment for LinuxCNC, and the next block for a Fanuc"),
        ("G07 X0.", "G7 makes X a diameter in LinuxCNC, and begins or ends hypothetical-axis interpolation"),
        ("G7", "G7 makes X a diameter"),
        ("G08", "G8 makes X a radius in LinuxCNC, and looks ahead in a Fanuc"),
        *((f"M{n}", f"M{n} belongs to LinuxCNC: ") for n in (*range(50, 54), 60, *range(62, 66), *range(70, 74))),
        ("M53 P1", "on a Fanuc or Haas the machine builder defines it (pallets, clamps, outputs)"),
        ("M61 Q1", "M61 belongs to LinuxCNC: sets the number of the current tool; on a Fanuc"),
        ("M66 P1 L0", "M66 belongs to LinuxCNC: inputs and outputs"),
        ("M67 E1 Q1.", "M67 belongs to LinuxCNC"),
        ("M68 E0 Q1.", "M68 belongs to LinuxCNC"),
        ("M19 R90.", "M19 R90. has the angle in R"),
        ("M19 P1", "M19 P1 has the angle in R"),
        ("G28", "G28 without axes moves all axes in LinuxCNC, and none in a Fanuc"),
        ("G30", "G30 without axes"),
        ("G28.1", "G28.1 stores the tool position in LinuxCNC"),
        ("G30.1 Z0", "G30.1 stores the tool position in LinuxCNC, and moves in a Fanuc"),
        ("G33 Z-1. K1.", "G33 reads the distance per turn from K in LinuxCNC, and from F in a Fanuc"),
        ("G41.1 D1.", "G41.1 reads the cutter diameter from D in LinuxCNC, and turns an axis"),
        ("G43.1 Z1.", "G43.1 sets the tool length offset to its words in LinuxCNC"),
        ("G43.2 H1", "G43.2 adds a tool length"),
        ("G43 H00", "G43 H00 uses the length of the tool in the spindle in LinuxCNC, and none in a Fanuc"),
        ("G41 X5.", "G41 without D uses the radius of the tool in the spindle in LinuxCNC, and the last D in a Fanuc"),
        ("G42", "G42 without D uses the radius"),
        ("G42 D00 X5.", "G42 D00 uses the radius of the tool in the spindle in LinuxCNC, and none in a Fanuc"),
        *((f"G18 G98 G8{n} X1. Y2. Z-1. R1. P0", f"G8{n} in G18 or G19 drills across") for n in (1, 2, 5, 9)),
        (
            "G98 G19 G81 X1. Y2. Z-1. R1.",
            "G81 in G18 or G19 drills across that plane in LinuxCNC, and along Z in a Fanuc",
        ),
        ("G98 G81 X1. Y2. Z-1. R1.\nG91 X3.", "G81 in G91 continues with R and depth of earlier lines"),
        (
            "M48",
            "M48 belongs to LinuxCNC: overrides on; on a Fanuc or Haas the machine builder defines it",
        ),
        ("M49", "M49 belongs to LinuxCNC: overrides off"),
        ("G70 P1 Q2", "G70 is a different cycle"),
        ("G71 P1 Q2", "G71 is a different cycle"),
        ("G72 I5. J0 L6.", "G72 is a different cycle"),
        ("G98 G86 X1. Z-1. R1. P1.", "G86 P1. dwells in LinuxCNC, and a Fanuc's G86 has no dwell"),
        ("G98 G86 X1. Z-1. R1.", "G86 without P is refused by LinuxCNC on the first line of a cycle"),
        ("G98 G89 X1. Z-1. R1.", "G89 without P is refused by LinuxCNC"),
        ("G2 I5. J0 P2", "P2 is the number of turns of an arc in LinuxCNC"),
        ("G64 G4 P500", "G4 P500 is 500 s for LinuxCNC, and 0.5 s for a Fanuc"),
        (
            "G54 P3 G64",
            "P3 belongs to G64 in LinuxCNC, and may belong to G54 in a Fanuc: put the two on separate lines",
        ),
        ("G64 M98 P1000", "M98 is read by LinuxCNC from separate files"),
    ],
)
def test_a_word_with_two_readings_is_asked_for(text: str, asked: str) -> None:
    program = f"{BEGIN}{text}\n{END}"
    found = question(program)
    assert asked in found
    line = 5 + text.count("\n") - (text.endswith("\nG90"))
    assert found.startswith(f"line {line}: ")
    assert found.endswith(
        "write the line so that both controls read it alike, or give --controller linuxcnc or --controller fanuc"
    )
    # LinuxCNC's own word anywhere decides it
    assert question(f"o100 sub\no100 endsub\n{program}") == ""


def test_what_is_stated_is_not_asked_for() -> None:
    assert question(f"{BEGIN}X100\n{END}", whole=True) == ""
    assert question(f"{BEGIN}G81 X1. Z-1. R1.\n{END}", startup="G98") == ""
    assert "G4 P5 is 5 s" in question(f"{BEGIN}X100\nG4 P5\n{END}", whole=True, startup="G98")


def test_codes_that_are_stated_count() -> None:
    program = "G1 X1.5 F10\nM30\n"
    assert question(program) == question(program, startup="G21 G94") == ""
    assert "F10 is 10 in per minute" in question(program, startup="g20")
    assert "F10 is 10 mm per turn" in question(program, startup="G95")


def test_a_program_without_y_may_be_a_lathes() -> None:
    lathe = "G21 (MY PART)\nG0 X50. Z2.\nG90 X48. Z-30. F0.2\nM30\n"
    assert "line 3: G90 with X and Z is a turning cycle" in question(lathe)
    assert question(lathe.replace("G0 X50.", "G0 X50. Y1.")) == ""


def test_every_kind_of_word_is_named_with_its_first_line() -> None:
    found = question(f"{BEGIN}X100\nX200\nG4 P5\nG92 X0\n{END}")
    assert found.startswith("line 5: X100 is 100 mm")
    assert "(and 1 more); line 7: G4 P5 is 5 s" in found
    assert "; line 8: G92 shares one store" in found


@pytest.mark.parametrize(
    "text",
    [
        "o100 sub",
        "O100 CALL [1] [2]",
        "o<a b> call",
        "N5 o[#1] while [#1 LT 2]",
        "/o1 if [1]",
        "#<depth>=2",
        "X[#<_x>+1]",
        "G64 P0.01",
        "G33.1 Z-1. K1.",
        "G38.2 Z-1.",
        "G91.1",
        "G59.3",
        "G5.1 X1. Y1. I1. J1.",
        "@1. ^30.",
        "#1=[#2+1] #3=2",
        "G96 D2000 S100",
        "G17 G40 G54 G64 P0.01 G80",
        "G54 G64 G17 P1",
        "G5 X1. Y1. I1. J1. P1. Q1.",
    ],
)
def test_what_only_linuxcnc_takes_decides(text: str) -> None:
    assert question(f"{BEGIN}{text}\nG4 P500\nX100\n{END}") == ""
    both = question(f"{BEGIN}{text}\n{END}N1 O2000\n")
    assert both.startswith("line 9: 'N1 O2000' is the beginning of a Fanuc's or Haas's program, and line 5: ")
    assert "remove the wrong one" in both


@pytest.mark.parametrize(
    "text",
    [
        "IF[#1GT2]GOTO10",
        "IF [#1 EQ 1] THEN #2=3",
        "WHILE [#1 LT 5] DO1",
        "GOTO 10",
        "END1",
        "#1=#2+1",
        "G65 P1 A1.",
        "G4 X1.",
        "G4 U1.",
        "/2 X1.",
        "N10 / X1.",
        "G1 X1. ,R2.",
        "G68 X0 Y0 R10.",
        "M29 S100",
        "G54.1 P1",
        "G5.1 Q1",
        "G05 P10000",
        "G5.1 Q1 X0 Y0 Z0",
        "G08 P1",
        "G07.1 C20.",
        "G107 C20.",
        "G91 G30 Z0. P2",
        "G54 P3",
        "G0 X1. G54 P3",
        "G33 Z-1. F1.",
        "G4",
        "POPEN",
    ],
)
def test_what_only_a_fanuc_takes_is_named(text: str) -> None:
    found = question(f"{BEGIN}{text}\n{END}")
    assert found.startswith(f"line 5: {text!r} is ")
    assert "give --controller fanuc (its dwells, cycles and lengths differ), or --controller linuxcnc" in found


@pytest.mark.parametrize(
    "text",
    [
        "G21 G90 O1001",
        "%O1000",
        "%  O1000 (PLATE)",
        "G21G90O1001",
        "T1(MILL)O1",
        "N5 G90 : 1001",
        "O1001 G90",
        "G1 X1. O 1 0 0 0",
        "#1=5. O1000",
    ],
)
def test_a_program_number_behind_words_is_a_fanucs(text: str) -> None:
    found = question(f"{text}\n{BEGIN}{END}")
    assert f"line 1: {text!r} is the beginning of a Fanuc's or Haas's program: give --controller fanuc" in found


def test_habits_answer_for_lengths_only() -> None:
    comment = f"; the plate\n{BEGIN}"
    assert question(f"{comment}X100\nG43\nG41\nG61\nG20\nF10\n{END}") == ""
    assert "G4 P500 is 500 s" in question(f"{comment}G4 P500\n{END}")
    assert "X100 is 100 mm" in question(f"{BEGIN}X100;\nY0;\n{END}")
    arc = "G2 X10 Y0. I5. J0\n"
    assert "X10 is 10 mm" in question(f"{BEGIN}{arc}{END}")  # a point may be forgotten once
    assert question(f"{BEGIN}{arc}G2 X0 Y0 I-5 J0.\n{END}") == ""


@pytest.mark.parametrize(
    "text",
    [
        ";O0042 - FLANGE",
        "; O1234 BRACKET",
        "; PROGRAM O1234",
        "%\n; O 1234 - side 2",
        "; job :1234 of today",
        "; finishing\n; see O770",
        "; the plate\n(O4005 COVER)",
        "; PRG-NR. 2207",
        "; %1234",
        "; O-1234",
        "; O1234.NC",
        "; CONTROL: 0I-MF",
        "; the plate\n(MACHINE: VF-2SS)",
        "; the plate\n(POST: FANUC 0i)",
        "; haas vf2",
    ],
)
def test_text_behind_a_semicolon_with_a_program_number_or_another_control_is_no_habit_of_linuxcnc(text: str) -> None:
    assert "X100 is 100 mm" in question(f"{text}\n{BEGIN}X100\n{END}")
    assert question(f"{text}\n(MSG, ready)\n{BEGIN}X100\n{END}") == ""


@pytest.mark.parametrize(
    "text",
    [
        "; go to X1",
        "; OP10 roughing",
        "; 10:30 o'clock",
        "; ratio 1:2",
        "; #O1",
        "; NO1 mill",
        "; O2 sensor side",
        "; bore o 12 H7",
        "; hole O10",
        "; side :2",
        "; file: 1001.5",
        "; AUTO 1",
    ],
)
def test_other_text_behind_a_semicolon_is(text: str) -> None:
    assert question(f"{text}\n{BEGIN}X100\n{END}") == ""


def test_habits_answer_for_a_radius_and_stored_codes_but_not_for_the_makers_codes() -> None:
    comment = f"; the plate\n{BEGIN}"
    assert question(f"{comment}G8\nM70\nM72\n{END}") == ""
    assert "G7 makes X a diameter" in question(f"{comment}G7\n{END}")
    assert "M62 belongs to LinuxCNC" in question(f"{comment}M62 P1\n{END}")


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("G1 X1O.", "column 6: an O-word must be at the beginning of the line; in a number write the digit 0"),
        ("G1 XO.", ""),
        ("G1 X1,5", "column 6: found ',', which is not the start of a word; numbers have a decimal point"),
        ("X50\nG1 X1O. G4 P5", "column 6: an O-word must be at the beginning"),
    ],
)
def test_a_slip_of_the_pen_is_no_word_with_two_readings(text: str, fault: str) -> None:
    found = question(f"{BEGIN}{text}\n{END}")
    assert fault in found
    assert "write the decimal point" not in found
    if fault:
        assert found.startswith(f"line {5 + text.count(chr(10))}: column ")


def test_behind_the_end_nothing_is_asked_for_but_numbers_count() -> None:
    assert question(f"{BEGIN}{END}G4 P500\n") == ""
    assert question(f"%\n{BEGIN}%\nX100\n") == ""
    assert "'o5'" in question(f"{BEGIN}{END}o5\n")
    assert "G4 P500 is 500 s" in question(f"{BEGIN}/M30\nG4 P500\n{END}")


@pytest.mark.parametrize("end", [END, "%\n", "N90 M02\n"])
@pytest.mark.parametrize(
    "sign", ["G64 P0.01", "o100 sub", "#<depth>=2", "G33.1 Z-1. K1.", "; a comment", "(MSG, done)"]
)
def test_behind_the_end_nothing_shows_linuxcnc(end: str, sign: str) -> None:
    assert "X100 is 100 mm" in question(f"{BEGIN}X100\n{end}{sign}\n")
    assert question(f"{BEGIN}X100\n{sign}\n{end}") == ""


@needs_programs
def test_few_programs_of_linuxcnc_are_asked_for_and_all_of_a_fanuc() -> None:
    """Those that are asked for are older than LinuxCNC's own words, and have lengths without a point."""
    assert all(question(path.read_text("latin-1")) for path in FANUC)
    asked = [path.name for path in sorted(PROGRAMS.rglob("*.ngc")) if question(path.read_text("latin-1"))]
    assert len(asked) <= 5, asked

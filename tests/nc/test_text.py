"""Shifts as they stand in words; frames between machine axes and program words; the unified diff; the header."""

import math
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thermocomp.core.exceptions import ProgramError
from thermocomp.nc.interpreter.block import Block, Modal
from thermocomp.nc.parser.line import Line, Word
from thermocomp.nc.rewrite import header
from thermocomp.nc.rewrite.diff import CONTEXT, unified
from thermocomp.nc.rewrite.text import DIGITS, LONGEST, Frame, format_number, part_comments, shift_words


def block(text: str, *words: tuple[str, str, float | None, float]) -> Block:
    """Return a block of words given as letter, value as written, number, value."""
    found = []
    for letter, value, plain, _ in words:
        start = text.index(letter + value)
        found.append(Word(letter.upper(), start, start + 1 + len(value), value, plain))
    line = Line(1, text, found)
    return Block(
        line,
        Modal(),
        words={w.letter: w for w in found},
        values={w[0].upper(): w[3] for w in words},
    )


@pytest.mark.parametrize(
    ("value", "text"),
    [(1.0, "1.0"), (-0.025, "-0.025"), (-0.00001, "0.0"), (12.34567, "12.3457"), (100.0, "100.0"), (0.0, "0.0")],
)
def test_a_number_has_a_point_and_no_idle_zeros(value: float, text: str) -> None:
    assert format_number(value, 4) == text


def test_untouched_words_stay_as_they_are() -> None:
    b = block("n10 g1 x1.50 Z - 1 . 5 (to Z)\r\n", ("x", "1.50", 1.5, 1.5), ("Z", " - 1 . 5", -1.5, -1.5))
    assert shift_words(b, {"X": 0.0, "Z": 0.0}, {}, 4) == b.line.text
    assert shift_words(b, {"Z": -0.025}, {}, 4) == "n10 g1 x1.50 Z-1.525 (to Z)\r\n"


def test_decimals_that_were_written_stay() -> None:
    b = block("X1.2345678", ("X", "1.2345678", 1.2345678, 1.2345678))
    assert shift_words(b, {"X": 0.001}, {}, 4) == "X1.2355678"


def test_an_expression_is_wrapped() -> None:
    b = block("G1 Z[#1+2]F100", ("Z", "[#1+2]", None, 7.0), ("F", "100", 100.0, 100.0))
    assert shift_words(b, {"Z": -0.025}, {}, 4) == "G1 Z[[#1+2]-0.025]F100"
    assert shift_words(b, {"Z": 0.025}, {}, 4) == "G1 Z[[#1+2]+0.025]F100"


def test_a_word_is_added_behind_the_last_one() -> None:
    b = block("X5 (note)\n", ("X", "5", 5.0, 5.0))
    assert shift_words(b, {"X": 0.01}, {"Z": -1.02}, 4) == "X5.01 Z-1.02 (note)\n"


def test_a_long_comment_gets_a_line_of_its_own() -> None:
    long = "a" * 230
    assert part_comments(f"N5 G1 X1.0 (b) Y2.0 ({long})\r\n") == (f"(b) ({long})\r\n", "N5 G1 X1.0  Y2.0\r\n")
    assert part_comments(f"G1 X1.0 ; {long} \n") == (f"; {long}\n", "G1 X1.0\n")
    for same in (f"G1 X1.0 (short){' ' * 200}\n", "G1" + " " * LONGEST + "X1\n"):
        assert part_comments(same) == (same,)


def test_digits_of_the_controllers() -> None:
    assert DIGITS["linuxcnc"].of(False) == 4
    assert DIGITS["fanuc"].of(True) == 4
    assert DIGITS["fanuc"].of(False) == 3


shifts = st.tuples(*[st.floats(-500, 500)] * 3)


@given(shifts, st.booleans(), st.sampled_from([0.0, 30.0, 90.0, -123.4]), st.booleans())
def test_a_frame_goes_there_and_back(
    shift: tuple[float, float, float], inch: bool, rotation: float, diameter: bool
) -> None:
    frame = Frame.of(Modal(inch=inch, rotation=rotation, diameter=diameter and rotation == 0), DIGITS["linuxcnc"])
    words = frame.words(shift)
    assert math.dist(frame.shift(words), shift) < 0.1  # um: rounding to the decimals
    assert frame.words(frame.shift(words)) == words


def test_a_frame_turns_with_the_coordinates() -> None:
    """At 90 degrees the program's X is the machine's Y."""
    frame = Frame.of(Modal(rotation=90.0), DIGITS["linuxcnc"])
    assert frame.words((10.0, 0.0, 5.0)) == (0.0, -0.01, 0.005)


def applied(original: list[str], diff: list[str]) -> Iterator[str]:
    """Apply a unified diff."""
    at = 0
    for line in diff:
        if line.startswith(("---", "+++", "\\")):
            continue
        if line.startswith("@@"):
            start, _, length = line.split()[1][1:].partition(",")
            begin = int(start) - (length != "0")
            yield from original[at:begin]
            at = begin
        elif line[0] == "+":
            yield line[1:]
        else:
            assert original[at] == line[1:]
            at += 1
            if line[0] == " ":
                yield line[1:]
    yield from original[at:]


@given(st.lists(st.sampled_from(["same", "same", "same", "same", "same", "changed", "inserted"]), max_size=60))
def test_the_diff_makes_the_revised_program(kinds: list[str]) -> None:
    pairs = []
    for k, kind in enumerate(kinds):
        text = f"X{k}\n"
        pairs.append((text, {"same": (text,), "changed": (f"X{k}.1\n",), "inserted": ("G52 Z0\n", text)}[kind]))
    diff = list(unified(pairs, "a", "b"))
    assert list(applied([p[0] for p in pairs], diff)) == [t for _, texts in pairs for t in texts]
    assert bool(diff) == any(k != "same" for k in kinds)
    for hunk in "".join(diff).split("@@ -")[1:]:
        lines = hunk.splitlines()[1:]
        assert [x[0] for x in lines[: CONTEXT + 1]] != [" "] * (CONTEXT + 1)


def test_the_diff_knows_lines_that_are_only_in_the_revised_program() -> None:
    diff = list(unified([("%\n", ("%\n",)), ("", ("(new)\n",)), ("X1\n", ("X2\n",))], "a", "b"))
    assert "".join(diff) == "--- a\n+++ b\n@@ -1,2 +1,3 @@\n %\n+(new)\n-X1\n+X2\n"


def test_a_missing_last_newline_is_told() -> None:
    assert list(unified([("X1", ("X2",))], "a", "b"))[-1] == "+X2\n\\ No newline at end of file\n"


def test_headers_have_the_same_number_of_lines() -> None:
    empty, full = header.make_blank("\r\n"), header.fill(["model (z.json)", "start: cold", "µm"], "\r\n")
    assert len(empty) == len(full) == header.LINES
    assert full[1] == "(THERMOCOMP model [z.json])\r\n"
    assert all(line.isascii() and line.count("(") == line.count(")") == 1 for line in full)
    assert all(len(line) <= header.WIDTH + 2 for line in header.fill(["x" * 200], "\n"))


def test_a_revised_program_is_refused() -> None:
    with pytest.raises(ProgramError, match="line 7: has been revised"):
        header.refuse_revised(Line(7, "", comment="THERMOCOMP REVISED"))


@pytest.mark.parametrize(
    ("text", "first"), [("%\n", True), ("O1234 (PART)\n", True), (":77\n", True), ("\n", True), ("G21\n", False)]
)
def test_what_stays_before_the_header(text: str, first: bool) -> None:
    assert header.comes_first(Line(1, text, demarcation=text == "%\n")) is first

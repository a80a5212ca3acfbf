import io
import re
from random import Random

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from nc_interpreter import PROGRAMS, needs_programs
from oracle_run import ends

from thermocomp.core.exceptions import InputError
from thermocomp.nc.parser.expressions import Parameters, evaluate
from thermocomp.nc.parser.line import Controller, Line
from thermocomp.nc.parser.squeezed import read_slowly
from thermocomp.nc.parser.tokens import program_lines, read_line, read_lines, split_lines

CONTROLLERS: tuple[Controller, ...] = ("linuxcnc", "fanuc")


def words(line: Line) -> list[tuple[str, str, float | None]]:
    return [(word.letter, word.value, word.number) for word in line.words]


def check(line: Line) -> None:
    """Check that columns and words belong together."""
    before = 0
    for word in line.words:
        assert before <= word.start < word.end <= len(line.text)
        before = word.end
        text = line.text[word.start : word.end]
        assert text[0].upper() == word.letter
        assert text.endswith(word.value)
        assert text[1 : len(text) - len(word.value)].strip(" \t") == ""
        assert word.value == word.value.strip()
        if word.number is not None:
            assert word.number == float(re.sub("[ \t]", "", word.value))
    for target, value, start, end in line.assignments:
        text = line.text[start:end]
        assert text[0] == target[0] == "#"
        assert text.endswith(value)
        assert all(end <= word.start or word.end <= start for word in line.words)
    if line.flow:
        assert line.flow in line.text
        assert not line.words
    if line.error:
        column = int(re.match(r"column (\d+): ", line.error)[1])  # type: ignore[index]
        assert 1 <= column <= len(line.text.rstrip(" \t\r\n\f\v")) + 1


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("G1 X10 Y-2.5\n", [("G", "1", 1.0), ("X", "10", 10.0), ("Y", "-2.5", -2.5)]),
        ("g01x.5y5.\r\n", [("G", "01", 1.0), ("X", ".5", 0.5), ("Y", "5.", 5.0)]),
        ("G 0 X - 1 . 5\tF 1 0 0", [("G", "0", 0.0), ("X", "- 1 . 5", -1.5), ("F", "1 0 0", 100.0)]),
        ("G0 X+00012.500", [("G", "0", 0.0), ("X", "+00012.500", 12.5)]),
        ("M6 T1 M3", [("M", "6", 6.0), ("T", "1", 1.0), ("M", "3", 3.0)]),
        ("G5.1 Q1", [("G", "5.1", 5.1), ("Q", "1", 1.0)]),
        ("X[#1+2]Z#5Y-#3", [("X", "[#1+2]", None), ("Z", "#5", None), ("Y", "-#3", None)]),
        ("X [ [1 + 2] * 3 ] Y1", [("X", "[ [1 + 2] * 3 ]", None), ("Y", "1", 1.0)]),
        ("Z#<_x> X## 2 Y#[#1 + 1]", [("Z", "#<_x>", None), ("X", "## 2", None), ("Y", "#[#1 + 1]", None)]),
        ("Xsin[30]Y-Cos[60]", [("X", "sin[30]", None), ("Y", "-Cos[60]", None)]),
        ("Xatan[1]/[2]Y1", [("X", "atan[1]/[2]", None), ("Y", "1", 1.0)]),
        ("X#5 2 Y1", [("X", "#5 2", None), ("Y", "1", 1.0)]),
        ("X--5 Y-+2", [("X", "--5", None), ("Y", "-+2", None)]),
        ("G1 @10 ^45", [("G", "1", 1.0), ("@", "10", 10.0), ("^", "45", 45.0)]),
        ("M3 $0 S100", [("M", "3", 3.0), ("$", "0", 0.0), ("S", "100", 100.0)]),
        ("X" + "1" * 40, [("X", "1" * 40, float("1" * 40))]),
        ("X5E3", [("X", "5", 5.0), ("E", "3", 3.0)]),
        ("", []),
        (" \t\f\r\n", []),
    ],
)
def test_words(text: str, expected: list[tuple[str, str, float | None]]) -> None:
    line = read_line(text, 7)
    assert line.error == ""
    assert words(line) == expected
    assert (line.number, line.text) == (7, text)
    check(line)


def test_words_tell_where_they_stand() -> None:
    text = "N5 G1 X - 1 . 5 (Z3) Y[1 + 2] ; Z9\n"
    line = read_line(text, 1)
    assert [text[word.start : word.end] for word in line.words] == ["G1", "X - 1 . 5", "Y[1 + 2]"]
    assert line.label == "5"
    assert line.comment == "Z3  Z9"


@pytest.mark.parametrize(
    ("text", "label", "optional", "comment"),
    [
        ("N120 G0", "120", False, ""),
        ("n 1 2 . 5 G0", "12.5", False, ""),
        ("/N7 G0", "7", True, ""),
        (" / G0", "", True, ""),
        ("(a) G0 (b;c)X1;d (e", "", False, "a b;c d (e"),
        ("; M\xe4rz \xb5m\n", "", False, " M\xe4rz \xb5m"),
        ("()(a) () (b)", "", False, "a b"),
        ("O100", "O100", False, ""),
        ("N3 o<part> (name)", "O<PART>", False, "name"),
    ],
)
def test_marks(text: str, label: str, optional: bool, comment: str) -> None:
    line = read_line(text, 1)
    assert line.error == line.flow == ""
    assert (line.label, line.optional, line.comment) == (label, optional, comment)
    check(line)


@pytest.mark.parametrize(
    ("text", "flow"),
    [
        ("o100 sub\n", "o100 sub"),
        ("O100 endsub (end)\n", "O100 endsub"),
        ("o<drill> call [1] [#2] (x) ; y", "o<drill> call [1] [#2]"),
        ("o 1 0 1 w h i l e [#1 LT 5]", "o 1 0 1 w h i l e [#1 LT 5]"),
        ("N5 o1 if [[1] EQ 1]", "o1 if [[1] EQ 1]"),
        ("o1 elseif [1]", "o1 elseif [1]"),
        ("o1 else", "o1 else"),
        ("o1 endif", "o1 endif"),
        ("o1 do", "o1 do"),
        ("o1 repeat [3]", "o1 repeat [3]"),
        ("o1 endrepeat", "o1 endrepeat"),
        ("o1 endwhile", "o1 endwhile"),
        ("o#1 break", "o#1 break"),
        ("o[1+1] continue", "o[1+1] continue"),
        ("/o1 return [5]", "o1 return [5]"),
    ],
)
def test_flow(text: str, flow: str) -> None:
    line = read_line(text, 1)
    assert line.error == ""
    assert line.flow == flow
    check(line)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("#5=1", [("#5", "1")]),
        ("#1 = 2 #<Max Depth> = [#1 + 1] G0 X1", [("#1", "2"), ("#<maxdepth>", "[#1 + 1]")]),
        ("# 1 2=-#<a>", [("#12", "-#<a>")]),
        ("##1=sin[3]#[2+3]=4", [("##1", "sin[3]"), ("#[2+3]", "4")]),
    ],
)
def test_assignments(text: str, expected: list[tuple[str, str]]) -> None:
    line = read_line(text, 1)
    assert line.error == ""
    assert [(target, value) for target, value, _, _ in line.assignments] == expected
    check(line)


@pytest.mark.parametrize("text", ["%", " % \r\n", "%\n"])
def test_demarcation(text: str) -> None:
    line = read_line(text, 1)
    assert line.demarcation
    assert line.error == ""


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("G1 X", "column 5: expected the value of X, found nothing"),
        ("G1 X Y2", "column 6: expected the value of X, found 'Y'"),
        ("G1 X- Y2", "column 7: expected the value of X, found 'Y'"),
        ("X.", "column 2: expected the value of X, found '.'"),
        ("X5.5.5", "column 5: found '.'"),
        ("G1 X1 X2", "column 7: X appears twice on the line, first in column 4"),
        ("G1 X[1+[2]", "column 5: the bracket '[' is not closed"),
        ("G1 X[1]]", "column 8: found ']'"),
        ("G1 X[1 (c) +2]", "column 8: a comment inside brackets"),
        ("G1 X1 (open", "column 7: the comment is not closed"),
        ("G1 (a (b))", "column 7: nested comments"),
        ("G1 X1)", "column 6: found ')'"),
        ("G1 X(c)1", "column 5: expected the value of X, found nothing"),
        ("G1 X1(c)2", "column 9: found '2'"),
        ("G1 X1*2", "column 6: found '*'"),
        ("G1 X1 ?", "column 7: found '?'"),
        ("G1 X1 \xe9", "column 7: found '\xe9'"),
        ("G1 X1 ,R2", "column 7: ',R' (corner rounding"),
        ("G1 X1 N5", "column 7: the line number N"),
        ("N5.5.5", "column 5: found '.'"),
        ("N-5", "column 1: the line number N"),
        ("N5 /G1", "column 4: block delete"),
        ("/2 G1", "column 2: found '2'"),
        ("G1 o1 if [1]", "column 4: an O-word"),
        ("G1 X1O.", "column 6: an O-word must be at the beginning of the line; in a number write the digit 0"),
        ("G1 XO.", "column 5: expected the value of X, found the letter O; write the digit 0"),
        ("G1 X1,5", "column 6: found ',', which is not the start of a word; numbers have a decimal point"),
        ("o1 gosub", "column 4: an O-word needs"),
        ("o1 if 1", "column 7: 'if' needs '['"),
        ("o1 if [1] G0", "column 11: expected only brackets and comments after the O-word, found 'G'"),
        ("o1 while [1", "column 10: the bracket"),
        ("#1", "column 3: '=' is missing after #1"),
        ("#1=", "column 4: expected the value of the parameter, found nothing"),
        ("#=1", "column 2: '#' needs"),
        ("#<a=1", "column 2: '#' needs"),
        ("% (c)", "column 1: '%' must be alone"),
        ("G1 %", "column 4: '%' must be alone"),
        ("G1 X" + "9" * 400, "column 4: the number of X is too large"),
        ("G1 X1\0Y2", "column 6: a NUL byte"),
        ("G1 X1\r", "column 6: a lone carriage return"),
        ("\xef\xbb\xbfG1", "column 1: a byte order mark"),
        ("(py, x=1)", "column 1: this comment runs Python"),
        ("G1 ;py,x", "column 4: this comment runs Python"),
        (":100", "column 1: found ':'"),
        ("IF [#1 EQ 2] GOTO 5", "column 2: expected the value of I, found 'F'"),
    ],
)
def test_errors_tell_the_column(text: str, error: str) -> None:
    line = read_line(text, 1)
    assert line.error.startswith(error)
    assert line.text == text
    check(line)


def test_words_before_an_error_are_there() -> None:
    assert words(read_line("G1 X1 *", 1)) == [("G", "1", 1.0), ("X", "1", 1.0)]


@pytest.mark.parametrize(
    ("text", "label", "flow", "optional"),
    [
        ("O1234 (PART)", "O1234", "", False),
        (":1234", ":1234", "", False),
        ("O<PART-1>", "O<PART-1>", "", False),
        ("<PART-1>", "<PART-1>", "", False),
        ("/2 N10 G0 X1;", "10", "", True),
        ("N10 /3 M8", "10", "", True),
        ("N10 IF [#1 EQ 2] GOTO 5 (c)", "10", "IF [#1 EQ 2] GOTO 5", False),
        ("IF[#1GT2]THEN #3=5", "", "IF[#1GT2]THEN #3=5", False),
        ("WHILE [#1 LT 5] DO1", "", "WHILE [#1 LT 5] DO1", False),
        ("WH[#1LT5]DO1", "", "WH[#1LT5]DO1", False),
        ("END1", "", "END1", False),
        ("GOTO 10", "", "GOTO 10", False),
        ("GOTO#1", "", "GOTO#1", False),
    ],
)
def test_fanuc(text: str, label: str, flow: str, optional: bool) -> None:
    line = read_line(text, 1, "fanuc")
    assert line.error == ""
    assert (line.label, line.flow, line.optional) == (label, flow, optional)
    check(line)


def test_fanuc_words_and_assignments() -> None:
    line = read_line("O1 G90 X#1 Y-[#2+1] M98 P1000", 1, "fanuc")
    assert [(word.letter, word.value) for word in line.words] == [
        ("G", "90"), ("X", "#1"), ("Y", "-[#2+1]"), ("M", "98"), ("P", "1000")
    ]  # fmt: skip
    line = read_line("#100 = #1 + 2 * SIN[#3] (c)", 1, "fanuc")
    assert line.error == ""
    assert line.assignments[0][:2] == ("#100", "#1 + 2 * SIN[#3]")
    check(line)


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("G1 X--5", "column 6: expected the value of X, found '-'"),
        ("G1 X1; G1 X2", "column 6: text after ';'"),
        ("G1 @10", "column 4: found '@'"),
        ("o1 sub", "column 5: expected the value of S, found 'U'"),
        ("DPRNT[X#1[53]]", "column 1: DPRNT is not supported"),
        ("N5.5 G1", "column 3: found '.'"),
        ("#1=", "column 4: expected the value of the parameter, found nothing"),
    ],
)
def test_fanuc_errors(text: str, error: str) -> None:
    line = read_line(text, 1, "fanuc")
    assert line.error.startswith(error)
    check(line)


def test_lines_are_numbered() -> None:
    assert [(line.number, line.text) for line in read_lines(["G0\n", "\n", "M2"])] == [
        (1, "G0\n"),
        (2, "\n"),
        (3, "M2"),
    ]


def test_lines_end_at_any_line_end() -> None:
    assert list(split_lines("a\nb\r\nc\rd\r\r\n\n\x0b\x0c\x1c\x85e")) == [
        "a\n", "b\r\n", "c\r", "d\r", "\r\n", "\n", "\x0b\x0c\x1c\x85e"
    ]  # fmt: skip


def test_lines_come_one_by_one() -> None:
    stream = io.StringIO("G0\n" * 100_000, newline="")
    lines = program_lines(stream)
    assert [next(lines), next(lines)] == ["G0\n"] * 2
    assert stream.tell() <= 9


def test_a_file_without_line_ends_is_refused() -> None:
    with pytest.raises(InputError, match="not an NC program"):
        list(split_lines("X" * 2_000_000))


@given(st.binary(max_size=300))
@example(b"\r\n\r\r\n\n")
def test_any_bytes_come_through(data: bytes) -> None:
    text = data.decode("latin-1")
    lines = list(split_lines(text))
    assert lines == re.findall(r"[^\r\n]*(?:\r\n|\r|\n)|[^\r\n]+", text)
    with io.TextIOWrapper(io.BytesIO(data), encoding="latin-1", newline="") as stream:
        assert list(program_lines(stream)) == lines
    for controller in CONTROLLERS:
        taken = list(read_lines(lines, controller))
        assert "".join(line.text for line in taken).encode("latin-1") == data
        for line in taken:
            check(line)


PIECES = st.sampled_from(
    [
        *"GMNOXYZFS#%/;:,*@$^=<>()[].+-1 \t\r\n\xff\0",
        *("G1", "X1", "Y-2.5", "Z [1 + #2]", "#<a>", "#5", "#3=", "(c)", "23", "sin", "if", "sub", "while", "call"),
        *("IF[", "GOTO", "py,"),
    ]
)


@example("() (a) () X1 ; ", "linuxcnc")
@given(st.lists(PIECES, max_size=12).map("".join), st.sampled_from(CONTROLLERS))
def test_both_ways_of_reading_agree(text: str, controller: Controller) -> None:
    line = read_line(text, 1, controller)
    assert line == read_slowly(text, 1, controller)
    check(line)


@pytest.mark.parametrize(
    "text",
    [
        *(piece * 100_000 for piece in ("G1", "X", "X1 ", "1 ", "(", "[", "#", "%", "/")),
        "X" + "1 " * 100_000,
        "X[" + "#" * 100_000,
        "o1 call" + "[1]" * 100_000,
        " " * 100_000 + "*",
    ],
    ids=lambda text: text[:3] + text[-3:],
)
@pytest.mark.parametrize("controller", CONTROLLERS)
def test_long_lines_do_not_hang(text: str, controller: Controller) -> None:
    check(read_line(text, 1, controller))  # quadratic time would be minutes


@needs_programs
def test_programs_of_linuxcnc() -> None:
    count = 0
    for path in sorted(PROGRAMS.rglob("*.ngc")):
        with path.open(encoding="latin-1", newline="") as stream:
            lines = list(read_lines(program_lines(stream)))
        assert "".join(line.text for line in lines).encode("latin-1") == path.read_bytes()
        for line in lines:
            check(line)
            assert line == read_slowly(line.text, line.number, "linuxcnc")
            # the one line of them that the interpreter does not understand either
            assert not line.error or line.text == "O<g20sub> callsub\n", (path, line)
        count += len(lines)
    assert count > 10_000


TEXTS = [
    *("X1", "Y-2.5", "Z 3 . 5", "X[1+2]", "Y#1", "Z-#<a>", "xsin[30]", "Xabs[-1]", "Y##2", "Z#[1+1]", "X--5", "x+-2"),
    *("#1=4", "#<a>=[1+1]", "(c)", ";c", "N7", "n8.5", "/", "Y.", "X", "Z1.2.3", *"[]*-(,% "),
]


@pytest.mark.usefixtures("interpreter")
@pytest.mark.parametrize("seed", range(4))
def test_the_interpreter_reads_the_same(seed: int) -> None:
    random = Random(seed)
    texts = [
        random.choice(["G0", "g 0 0 "]) + "".join(random.choices(TEXTS, k=random.randint(1, 4))) for _ in range(300)
    ]
    texts += ["".join(random.choices(TEXTS, k=random.randint(1, 4))) for _ in range(100)]
    accepted = 0
    for text, truth in zip(texts, ends([f"G0\n#1=2 #2=1 #<a>=5\n{text}" for text in texts]), strict=True):
        line = read_line(text, 1)
        check(line)
        if truth is None:  # a % alone depends on the lines before
            assert line.error or line.demarcation, f"{text}: the interpreter refuses it"
            continue
        assert line.error == "", f"{text}: {line.error}, but the interpreter takes it"
        accepted += 1
        parameters = Parameters(values={**dict.fromkeys(range(1, 5001), 0.0), 1: 2.0, 2: 1.0, "a": 5.0})
        values = {word.letter: evaluate(word.value, parameters) for word in line.words}
        assert truth == pytest.approx([values.get(axis, 0.0) for axis in "XYZ"], abs=1e-9), text
    assert 50 < accepted < 350

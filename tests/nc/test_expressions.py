import math
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from oracle_run import ends

from thermocomp.core.exceptions import InputError
from thermocomp.nc.parser.expressions import Parameters, evaluate
from thermocomp.nc.parser.line import Assignment
from thermocomp.nc.parser.systemparameters import explain_unset

KNOWN: dict[int | str, float] = {1: 2.0, 2: 5.0, 3: -0.5, "depth": 7.25, "_way": 3.0}


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("12.5", 12.5),
        (" - 1 . 5 ", -1.5),
        (".5", 0.5),
        ("5.", 5.0),
        ("+5", 5.0),
        ("--5", 5.0),
        ("[1+2*3]", 7.0),
        ("[[1+2]*3]", 9.0),
        ("[2**3**2]", 64.0),  # from left to right
        ("[-2**2]", 4.0),  # the sign belongs to the 2
        ("[8-4-2]", 2.0),
        ("[16/4/2]", 2.0),
        ("[-7 MOD 3]", 2.0),
        ("[7 mod -3]", 1.0),
        ("[1+2*3 GT 6]", 1.0),
        ("[1 OR 0 XOR 1]", 0.0),
        ("[2 AND 3]", 1.0),
        ("[1 EQ 1.00001]", 1.0),
        ("[1 NE 1.00001]", 0.0),
        ("#1", 2.0),
        ("##1", 5.0),
        ("-#1", -2.0),
        ("#[#1 - 1]", 2.0),
        ("#<Depth>", 7.25),
        ("# < D e p t h >", 7.25),
        ("[#<_way>*#2]", 15.0),
        ("sin[30]", 0.5),
        ("-Cos[60]", -0.5),
        ("tan[45]", 1.0),
        ("atan[1]/[-1]", 135.0),
        ("[atan[1]/[1]/9]", 5.0),
        ("asin[-1]", -90.0),
        ("acos[0]", 90.0),
        ("exp[0]", 1.0),
        ("ln[exp[2]]", 2.0),
        ("sqrt[16]", 4.0),
        ("abs[-3]", 3.0),
        ("fix[-2.5]", -3.0),
        ("fup[-2.5]", -2.0),
        ("round[-2.5]", -3.0),
        ("round[2.5]", 3.0),
        ("exists[#<depth>]", 1.0),
        ("exists[#<height>]", 0.0),
        ("exists[#31]", 1.0),
        ("exists[#<_x>]", 1.0),
    ],
)
def test_values(text: str, value: float) -> None:
    assert evaluate(text, Parameters(values=KNOWN)) == pytest.approx(value, abs=1e-12)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "found the end"),
        ("[1+]", r"found '\]'"),
        ("[1", "found the end"),
        ("[1]]", r"expected the end of the value, found '\]'"),
        ("[1,2]", "found ',2"),
        ("1+2", r"expected the end of the value, found '\+2'"),
        ("1.5.5", r"found '\.5'"),
        ("[1/0]", "no value"),
        ("[1 MOD 0]", "no value"),
        ("[0**-1]", "no value"),
        ("[-8**0.5]", "no value"),
        ("sqrt[-1]", "no value"),
        ("ln[0]", "no value"),
        ("acos[2]", "no value"),
        ("tan[-270]", "TAN of -270 degrees"),
        ("sin[10**12]", "an angle of 1e.12 degrees"),
        ("exp[1000]", "no value"),
        ("9" * 400, "too large"),
        ("[" * 2000, "nested brackets"),
        ("bin[3]", "BIN is not supported"),
        ("bcd[3]", "BCD is not supported"),
        ("sin 30", "found 'sin30'"),
        ("atan[1]", r"'/\['"),
        ("exists[1]", r"'\[#' after EXISTS"),
        ("exists[#<_far>]", "another program may have set it"),
        ("#", "after '#'"),
        ("#0", "0 is not the number of a parameter"),
        ("#[1.2]", "1.2 is not the number of a parameter"),
        ("#77", "#77 is unknown: the program has not set it before"),
        ("[1+#<width>]", "#<width> is unknown: the program has not set it before"),
        ("#5063", "result of a probe move"),
        ("#5161", "home position of G28"),
        ("#5220", "number of the work coordinate system"),
        ("#5221", "origin or rotation of a work coordinate system"),
        ("#5403", "data of the tool"),
        ("#5422", "present position"),
        ("#<_z>", "present position"),
        ("#<_abs_z>", "present position"),
        ("#<_current_tool>", "tool of the machine"),
        ("#<_metric>", "modal state"),
        ("#<_hal[spindle.0.speed-out]>", "setting or signal"),
    ],
)
def test_refusals(text: str, reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        evaluate(text, Parameters(values=KNOWN))


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("#1+#2*3", 17.0),  # assignments have no brackets
        ("[#1+1]*3", 9.0),
        ("#1*SIN[30]", 1.0),
        ("FIX[-2.5]", -2.0),
        ("FUP[-2.5]", -3.0),
        ("-7 MOD 3", -1.0),
        ("6 AND 3", 2.0),
        ("4 OR 1 XOR 4", 1.0),
        ("1 EQ 1.00001", 0.0),
        ("2 + 4 AND 6", 6.0),  # AND binds as * does
        ("ATAN[1]/[1]", 45.0),
    ],
)
def test_fanuc(text: str, value: float) -> None:
    assert evaluate(text, Parameters("fanuc", KNOWN)) == pytest.approx(value, abs=1e-12)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("ROUND[#1]", "least increment"),
        ("EXISTS[#1]", "LinuxCNC"),
        ("2**3", r"\*\* is not an operator of fanuc"),
        ("ASIN[-0.5]", "-30 or 330 degrees"),
        ("1.5 AND 1", "whole numbers"),
        ("#3001", "clock"),
        ("#5041", "present position"),
        ("#1005", "interface signal"),
        ("#5221", "origin of a work coordinate system"),
    ],
)
def test_fanuc_refusals(text: str, reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        evaluate(text, Parameters("fanuc", KNOWN))


def assignments(*pairs: tuple[str, str]) -> list[Assignment]:
    return [Assignment(target, value, 0, 0) for target, value in pairs]


def test_assignments_of_a_line_are_parallel() -> None:
    parameters = Parameters(values={1: 5.0})
    parameters.assign(assignments(("#1", "10"), ("#2", "#1"), ("#<A b>", "[#1*2]"), ("#[3+1]", "1")))
    assert [parameters[key] for key in (1, 2, "ab", "A B", 4)] == [10.0, 5.0, 10.0, 10.0, 1.0]


@pytest.mark.parametrize("target", ["#5223", "#<_z>", "#5401", "#6000"])
def test_parameters_of_the_machine_are_not_set(target: str) -> None:
    parameters = Parameters()
    with pytest.raises(InputError, match="changes the machine"):
        parameters.assign(assignments(("#1", "2"), (target, "1")))
    assert 1 not in parameters


def test_a_failed_line_changes_nothing() -> None:
    parameters = Parameters(values={1: 1.0})
    with pytest.raises(InputError):
        parameters.assign(assignments(("#1", "2"), ("#2", "#9")))
    assert parameters[1] == 1.0
    assert 2 not in parameters


def test_what_is_forgotten_tells_why() -> None:
    parameters = Parameters(values={5: 1.0})
    parameters.forget("#[2 + 3]", "the optional line 7 sets it")
    with pytest.raises(InputError, match="#5 is unknown: the optional line 7 sets it"):
        evaluate("[#5]", parameters)
    parameters.assign(assignments(("#5", "2")))
    assert evaluate("#5", parameters) == 2.0


@pytest.mark.parametrize("target", ["5", "#", "#5]", "#[1", "x"])
def test_targets_that_are_none(target: str) -> None:
    with pytest.raises(InputError):
        Parameters().key(target)


def test_every_parameter_is_told() -> None:
    assert explain_unset(12) == explain_unset("depth") == "the program has not set it before"
    assert all("only the machine knows" in explain_unset(number) for number in range(5061, 5071))
    assert "reserved" in explain_unset(5700)
    assert "system variable" in explain_unset(9000, "fanuc")
    assert "has not set" in explain_unset(500, "fanuc")


@given(st.text("0123456789.+-*/[]#<>abcosinexrmd \t", max_size=40))
def test_any_text_has_a_value_or_is_refused(text: str) -> None:
    for parameters in (Parameters(values=KNOWN), Parameters("fanuc", KNOWN)):
        try:
            value = evaluate(text, parameters)
        except InputError:
            continue
        assert math.isfinite(value)


NUMBERS = ["0", "1", "2", "3.", ".5", "0.25", "1 2", "7.125", "30", "90", "-4", "+ 1.5", "--2"]
PARAMETERS = ["#1", "##1", "-#2", "#[1+1]", "#3", "#<depth>", "#<D epth>", "#<_way>", "#<none>"]
FUNCTIONS = ["abs", "acos", "asin", "cos", "exp", "fix", "fup", "ln", "round", "sin", "sqrt", "tan", "S I N"]
OPERATORS = ["+", "-", "*", "/", " MOD ", "**", " AND ", "or", " Xor ", "EQ", " ne ", "GT", "ge", " lt ", "LE"]


def expression(random: Random, depth: int) -> str:
    """Return a value as it may be written."""
    kind = random.randrange(6) if depth else random.randrange(2)
    if kind == 0:
        return random.choice(NUMBERS)
    if kind == 1:
        return random.choice(PARAMETERS)
    values = [expression(random, depth - 1) for _ in range(random.randint(1, 4))]
    bracket = f"[{values[0]}{''.join(random.choice(OPERATORS) + value for value in values[1:])}]"
    if kind == 2:
        return random.choice(FUNCTIONS) + bracket
    if kind == 3:
        return f"atan{bracket}/[{expression(random, depth - 1)}]"
    return random.choice(["", "-"]) + bracket


@pytest.mark.usefixtures("interpreter")
@pytest.mark.parametrize("seed", range(5))
def test_values_are_those_of_the_interpreter(seed: int) -> None:
    random, parameters = Random(seed), Parameters(values=KNOWN)
    texts = [text for _ in range(400) if len(text := expression(random, 3)) < 200]  # a line has at most 255 characters
    before = "#1=2 #2=5 #3=-.5 #<depth>=7.25 #<_way>=3"
    refused = 0
    for text, truth in zip(texts, ends([f"{before}\nG0X{text}" for text in texts]), strict=True):
        try:
            value: float | None = evaluate(text, parameters)
        except InputError:
            value = None
            refused += 1
        if value is not None and truth is not None:
            assert value == pytest.approx(truth[0], rel=1e-9, abs=1e-9), text
        elif value is not None or not any(part in text for part in (" MOD ", "**", "tan[")):
            # the interpreter may continue with 1 MOD 0 or 0 ** -1 (not a number, infinity) and lose it in a comparison;
            # its tan[90] is 1.6e16
            assert value is None, f"{text}: {value}, but the interpreter refuses it"
            assert truth is None, f"{text}: refused, but the interpreter has {truth}"
    assert refused < len(texts) / 2  # most have a value

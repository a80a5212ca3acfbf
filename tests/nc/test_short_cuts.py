"""Short cuts behind stops, dwells, tool changes and machine coordinates: revised, or refused for a reason."""

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st
from nc_law import STATED, Growing, revise

from thermocomp.core.exceptions import ProgramError, Unprovable
from thermocomp.nc.interpreter.block import Setup
from thermocomp.nc.linuxcnc.verification import states

HEAD = "G21 G90 G17 G40 G80 G94 G54\nG64 P0.01 G99\nT5 M6\nS12000 M3\nG43 H5\nG0 X0 Y0 Z20\n"
#: a program is short enough as it is drawn
PHASES = (Phase.explicit, Phase.generate)
#: what is stated; with origins a move behind machine coordinates may be short as well
SETUPS = (
    replace(STATED, startup="G64 P0.01 G99"),
    replace(
        STATED,
        startup="G64 P0.01 G99",
        offsets=dict.fromkeys(range(1, 10), (0.0, 0.0, 0.0)),
        tools=dict.fromkeys(range(1, 100), 0.0),
        home=(0.0, 0.0, 0.0),
    ),
)
EVENTS = (
    "M1", "M1", "M0", "G4 P5", "G4 P60", "M5\nS8000 M3", "T6 M6\nS9000 M3", "G0 Z5", "G0 Z20", "G53 G0 Z0",
    "G53 G1 Z-2.5 F500", "G53 G1 Z-2.5 F20", "G53 G1 Z-1 A3 F50", "G30 Z5",
    "G91 G28 Z0\nG90", "G28 X0 Y0", "G98 G81 X1 Y2 Z-4 R-1 F100\nX2\nG80",
)  # fmt: skip
ODD = (
    "G91\nG1 X0.2 Z-0.1\nG90", "G1 Z-3.1\nG3 I0.5 J0", "G93\nG1 X1 F20\nG94 F100", "G95 F0.1\nG1 Y3\nG94 F100",
    "G20\nG1 X0.01 F3\nG21\nF100", "G1 X0 Y0", "G1 Z-3.5\nM1\nZ-3.5",
)  # fmt: skip
_near = st.sampled_from((0.05, 0.2, 0.5, 2.0, 10.0)).flatmap(lambda d: st.floats(-d, d).map(lambda v: round(v, 3)))


@st.composite
def cuts(draw: st.DrawFn) -> str:
    """Draw a program of short cuts with something between them."""
    lines = [f"G1 Z{draw(st.floats(-4.0, -1.0)):.3f} F{draw(st.sampled_from((50, 100, 300, 1000)))}"]
    for _ in range(draw(st.integers(3, 8))):
        lines.append(draw(st.sampled_from(EVENTS)))
        if draw(st.integers(0, 5)) == 0:
            lines.append(draw(st.sampled_from(ODD)))
        for _ in range(draw(st.integers(1, 3))):
            axes = draw(st.sampled_from(("X", "Y", "Z", "Z", "XY", "XZ", "XYZ")))
            words = " ".join(f"{axis}{draw(_near) - 3.0 * (axis == 'Z'):.3f}" for axis in axes)
            lines.append(f"{draw(st.sampled_from(('G1', 'G1', 'G0')))} {words}")
    return HEAD + "\n".join([*lines, "G0 Z20", "M30"]) + "\n"


def judge(text: str, rate: tuple[float, float, float], setup: Setup, count: int) -> None:
    """Revise and prove a program in so many states; fail if thermocomp finds a fault of its own."""
    with TemporaryDirectory() as name, pytest.MonkeyPatch.context() as patch:
        patch.setattr(states, "STATES", count)
        path = Path(name) / "part.ngc"
        path.write_text(text, encoding="ascii")
        refusal = ""
        try:
            revise(path, path.parent, Growing(rate=rate, slope=0.0), "coordinates", setup=setup).proved()
        except (ProgramError, Unprovable) as error:
            refusal = str(error)
        assert "please report" not in refusal, text


_rates = st.tuples(*[st.sampled_from((-0.3, -0.1, 0.1, 0.3))] * 3)
#: a short plunge, a short cut in the plane, and one that goes to where the tool is, each behind a stop
PLUNGE = HEAD + "G1 Z-3.479 F100\nM1\nG1 Y10\nZ-2.962\nG0 Z20\nM30\n"
ASIDE = HEAD + "G1 Z-3.38 F50\nM1\nG1 X0.016\nG0 Z20\nM30\n"
AGAIN = HEAD + "G1 Z-3.013 F300\nM1\nZ-3.013\nG0 Z20\nM30\n"


@pytest.mark.usefixtures("interpreter")
@pytest.mark.parametrize("text", [PLUNGE, ASIDE, AGAIN])
@pytest.mark.parametrize("rate", [(0.3, 0.3, 0.3), (-0.2, -0.2, -0.4)])
def test_a_short_cut_behind_a_stop_is_revised(text: str, rate: tuple[float, float, float], tmp_path: Path) -> None:
    path = tmp_path / "part.ngc"
    path.write_text(text, encoding="ascii")
    trial = revise(path, tmp_path, Growing(rate=rate, slope=0.0), "coordinates", setup=SETUPS[0])
    assert trial.proved().moves >= 4
    # what a short cut could not take up the next rapid does
    assert abs(trial.rows[-1].carried[2] + trial.rows[-1].deviation[2]) <= 1.0


#: a long cut, in which the correction grows, then machine coordinates by the feed
LONG = HEAD + "G1 Z-1 F200\nG1 X300 F30\n{}\nG0 Z50\nM30\n"


@pytest.mark.usefixtures("interpreter")
@pytest.mark.parametrize("line", ["G53 G1 Z-1.5 F300", "G53 G1 Z-1 F100", "G53 G1 X0 Y0 F100", "M1\nG53 G1 Z-1 F20"])
@pytest.mark.parametrize("setup", SETUPS)
def test_what_is_given_back_by_the_feed_takes_its_time(line: str, setup: Setup, tmp_path: Path) -> None:
    path = tmp_path / "part.ngc"
    path.write_text(LONG.format(line), encoding="ascii")
    drift = Growing(rate=(0.1, 0.1, 0.3), slope=0.0)
    trial = revise(path, tmp_path, drift, "coordinates", setup=setup)
    assert trial.proved().moves >= 5
    assert abs(trial.rows[8].carried[2]) > 50.0


@pytest.mark.usefixtures("interpreter")
@pytest.mark.parametrize("setup", SETUPS)
def test_a_rotary_axis_does_not_turn_by_a_feed_that_would_count_mm(setup: Setup, tmp_path: Path) -> None:
    path = tmp_path / "part.ngc"
    path.write_text(LONG.format("G53 G1 Z-1 A0 F100"), encoding="ascii")
    with pytest.raises(ProgramError, match=r"line 9: the line turns a rotary axis at feed rate .* write G53 G0"):
        revise(path, tmp_path, Growing(rate=(0.1, 0.1, 0.3), slope=0.0), "coordinates", setup=setup)


@pytest.mark.usefixtures("interpreter")
@settings(max_examples=15, derandomize=True, phases=PHASES)
@given(cuts(), _rates, st.sampled_from(SETUPS))
def test_no_program_of_short_cuts_is_a_fault(text: str, rate: tuple[float, float, float], setup: Setup) -> None:
    judge(text, rate, setup, 1)


@pytest.mark.long
@pytest.mark.usefixtures("interpreter")
@settings(max_examples=300, phases=PHASES)
@example(PLUNGE, (0.3, 0.3, 0.3), SETUPS[1])
@given(cuts(), _rates, st.sampled_from(SETUPS))
def test_no_program_of_short_cuts_is_a_fault_in_any_state(
    text: str, rate: tuple[float, float, float], setup: Setup
) -> None:
    judge(text, rate, setup, 3)

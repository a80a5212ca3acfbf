"""Random programs, and all those of the linuxcnc package: revised rightly, judged by its interpreter, or refused."""

from collections import Counter
from pathlib import Path

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from nc_interpreter import PROGRAMS, needs_programs
from nc_law import Growing, Steady, Still, Trial, revise
from random_programs import programs

from thermocomp.core.exceptions import InputError, ProgramError
from thermocomp.nc.linuxcnc import rs274
from thermocomp.nc.rewrite import header

pytestmark = pytest.mark.usefixtures("interpreter")


def tried(path: Path, folder: Path, drift: Steady, way: str, every: float | None = None) -> Trial | InputError:
    """Return a revised program, or why it was refused."""
    try:
        return revise(path, folder, drift, way, every=every)
    except InputError as error:
        return error


def unproved(trial: Trial) -> str:
    """Return why a revised program cannot be proved; nothing if it is."""
    try:
        trial.proved()
    except ProgramError as error:
        return error.reason
    return ""


@pytest.mark.long
@given(programs, st.sampled_from(["coordinates", "offset"]), st.sampled_from([None, 5.0]))
@example("G21 G90\nF100 S1000 M3\nG1 X0\nG17 G90 G81 X1 Z-1 R0.2\nG98 X2\nG80\nM2\n", "coordinates", None)
# where the cycle leaves Y depends on where it stood: the arc after it is shifted as a whole, or not at all
@example(
    "G21 G90\nF100 S1000 M3\nG1 X0\nM3 G18 G98 G81 X0 Y0.375 R0.5\nG80\nG91 G17 G2 X0 Y0.125 I0 J0.0625\nM2\n",
    "coordinates",
    None,
)
# X0 in G91 moves nothing, before a cycle as well
@example(
    "G21 G90\nF100 S1000 M3\nG1 X0\nM3 G17 G91 G98 G84 X0.000000 Z-0.125 R0.0 L2\nX0.000000\nG80\nM2\n",
    "coordinates",
    None,
)
@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
def test_a_random_program_keeps_the_law_or_is_refused(
    tmp_path_factory: pytest.TempPathFactory, text: str, way: str, every: float | None
) -> None:
    folder = tmp_path_factory.mktemp("law")
    path = folder / "program.ngc"
    path.write_text(text)
    trial = tried(path, folder, Growing(), way, every)
    if isinstance(trial, Trial):
        doubt = unproved(trial)  # what it depends on is not stated: it is not written either
        assert not doubt or "not stated, so the program cannot be proved; " in doubt
    elif isinstance(trial, ProgramError):
        assert "please report" not in trial.reason  # it has not passed its own check
    else:
        assert "is not plausible as thermal drift" in str(trial)  # a program of hours, a drift of 0.1 um/s


@pytest.mark.long
@needs_programs
@pytest.mark.parametrize("way", ["coordinates", "offset"])
def test_the_programs_of_linuxcnc_as_they_are(way: str, tmp_path: Path) -> None:
    """As text, without unrolling; see test_expanded_law for those with loops and subprograms."""
    counts: Counter[str] = Counter()
    for path in sorted(PROGRAMS.rglob("*.ngc")):
        try:
            for _ in rs274.read(path):
                pass
        except ProgramError:
            counts["refused by the interpreter"] += 1
            continue
        trial = tried(path, tmp_path, Growing(rate=(0.01, -0.01, 0.02)), way)
        if isinstance(trial, Trial):
            trial.proved()
            counts["revised"] += 1
        else:
            assert isinstance(trial, ProgramError)
            assert trial.line >= 1
            assert "please report" not in trial.reason
            counts["refused"] += 1
    print(f"{way}: {dict(counts)} of {counts.total()}")
    assert counts["revised"] >= 15


@needs_programs
def test_without_drift_the_programs_stay_as_they_are(tmp_path: Path) -> None:
    marks = "".join(header.make_blank("\n")).encode()
    compared = 0
    for path in sorted(PROGRAMS.glob("*.ngc")):
        try:
            trial = revise(path, tmp_path, Still(), "coordinates")
        except ProgramError:
            continue
        assert trial.revised.read_bytes().replace(b"\r\n", b"\n").replace(marks, b"") == path.read_bytes().replace(
            b"\r\n", b"\n"
        )
        compared += 1
    assert compared >= 15

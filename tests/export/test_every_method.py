"""Every method that `fit` knows goes to every target, or is refused by a refusal that is documented."""

import subprocess
import sys
from itertools import product
from pathlib import Path

import pytest
from compiledblock import COMPILERS, FLAGS
from everymethod import REDUCED, WHOLE, Fitted, documented, refusals, without_speed
from smallmachine import small_machine

import thermocomp as tc
from thermocomp.cli.app import run
from thermocomp.core.exceptions import FitError, InputError
from thermocomp.models.methods import METHODS

#: of the ordinary run: to every target, and as C
EVERYWHERE, AS_C = ("ols", "averaged"), ("mra", "dynamic", "ace", "mlp", "arx")


@pytest.fixture(scope="session")
def fitted(tmp_path_factory: pytest.TempPathFactory) -> Fitted:
    return Fitted(tmp_path_factory.mktemp("fitted"))


def export(fitted: Fitted, target: str, folder: Path, method: str, *, speed: bool, watched: bool) -> int:
    to, _, dialect = target.partition("-")
    words = ["--dialect", dialect] if dialect else []
    if to in REDUCED:
        words = [str(fitted.recording(speed=speed)), "--jobs", "1"]
    model = fitted.model(method, speed=speed, watched=watched)
    return run(["export", str(model), *words, "--to", to, "-o", str(folder)])


def cases() -> list[object]:
    found: list[object] = []
    for method, (alone, whole, _) in documented().items():
        if whole == "no":
            continue
        for speed, watched, target in product((True, False), (True, False), (*WHOLE, *REDUCED)):
            if not speed and alone == "no":
                continue
            ordinary = (method in EVERYWHERE and watched and not speed) or (
                method in AS_C and target == "c99" and watched
            )
            name = f"{method}-{'speed' if speed else 'none'}-{'watched' if watched else 'plain'}-{target}"
            marks = () if ordinary else pytest.mark.long
            found.append(pytest.param(method, speed, watched, target, id=name, marks=marks))
    return found


def test_every_method_is_documented() -> None:
    assert set(documented()) == set(METHODS)
    assert len(refusals()) > 10


@pytest.mark.parametrize(("method", "speed", "watched", "target"), cases())
def test_it_goes_there_or_is_refused_as_documented(
    fitted: Fitted,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    method: str,
    speed: bool,
    watched: bool,
    target: str,
) -> None:
    if target == "onnx":
        pytest.importorskip("onnx")
    code = export(fitted, target, tmp_path, method, speed=speed, watched=watched)
    said = " ".join("".join(capsys.readouterr()).split())
    if code:
        assert target in REDUCED, said
        assert any(text in said for text in refusals()), said
        return
    assert list(tmp_path.glob("tc_thermal*"))
    if target == "c99":
        prove(tmp_path)
    elif target in (*REDUCED, "onnx"):
        program = "tc_thermal_test.py" if target == "onnx" else "tc_thermal_check.py"
        subprocess.run([sys.executable, program], cwd=tmp_path, check=True, stdout=subprocess.DEVNULL)


def prove(folder: Path) -> None:
    """Compile and run its own test, in double and in single precision."""
    if not COMPILERS:
        pytest.skip("there is no C compiler")
    for switch in ("-UTC_FLOAT", "-DTC_FLOAT"):
        command = [COMPILERS[0], *FLAGS, switch, "tc_thermal.c", "tc_thermal_test.c", "-lm", "-o", "prove"]
        built = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        if switch == "-DTC_FLOAT" and "single precision is too coarse" in built.stderr:
            assert "single precision is too coarse" in refusals()
            continue
        assert built.returncode == 0, built.stderr
        ran = subprocess.run(["./prove"], cwd=folder, capture_output=True, text=True, check=False)
        assert ran.returncode == 0, ran.stdout


@pytest.mark.parametrize("method", [m for m, (alone, *_) in documented().items() if alone == "no"])
def test_what_cannot_be_fitted_without_a_speed_says_so(method: str) -> None:
    with pytest.raises((InputError, FitError)) as found:
        tc.fit(without_speed(small_machine()), "z_um", method)
    assert any(text in str(found.value) for text in refusals())
    if documented()[method][1] == "no":
        with pytest.raises(InputError, match="cannot be stored as coefficients"):
            tc.fit(small_machine(), "z_um", method)

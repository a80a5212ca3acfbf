"""The C code on a microcontroller: cross-compiled for a Cortex-M7, and its test vectors run on an emulated one."""

import shutil
import subprocess
from pathlib import Path

import pytest
from watchedmachine import watched_model

from thermocomp.core.correction import Limits
from thermocomp.export.c99.package import write_package
from thermocomp.export.facts import Facts
from thermocomp.runtime.compensator import Compensator

BOARD = Path(__file__).parent / "cortexm7"
TARGET = ["-mcpu=cortex-m7", "-mthumb", "-mfpu=fpv5-d16", "-mfloat-abi=hard", "--specs=rdimon.specs", "-nostartfiles"]
STRICT = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O2"]

pytestmark = pytest.mark.skipif(
    not (shutil.which("arm-none-eabi-gcc") and shutil.which("qemu-system-arm")),
    reason="there is no compiler for a Cortex-M, or no emulator of one",
)


@pytest.mark.parametrize("precision", [[], ["-DTC_FLOAT"]])
def test_its_vectors_pass_on_a_cortex_m7(tmp_path: Path, precision: list[str]) -> None:
    compensator = Compensator.of([watched_model("z_um"), watched_model("x_um")], Limits(dead_band=0.2))
    texts = write_package(compensator, "mill", Facts("model.json", "", "0", "2026-01-31"))
    for name, text in texts.items():
        (tmp_path / name).write_bytes(text)
    board = ["-T", str(BOARD / "memory.ld"), str(BOARD / "startup.c")]
    code = ["tc_mill.c", "tc_mill_test.c", "-lm", "-o", "mill.elf"]
    subprocess.run(["arm-none-eabi-gcc", *STRICT, *precision, *TARGET, *board, *code], cwd=tmp_path, check=True)
    machine = ["qemu-system-arm", "-M", "mps2-an500", "-cpu", "cortex-m7", "-nographic", "-kernel", "mill.elf"]
    told = ["-semihosting-config", "enable=on,target=native"]
    done = subprocess.run(
        [*machine, *told],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        stdin=subprocess.DEVNULL,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert ", 0 wrong;" in done.stdout

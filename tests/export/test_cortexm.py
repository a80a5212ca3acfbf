"""The C code on a microcontroller: cross-compiled for a Cortex-M7, and its test vectors run on an emulated one."""

import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from driftmodels import ACCEPTED
from watchedmachine import watched_model

from thermocomp.core.correction import Limits
from thermocomp.export.c99.package import write_package
from thermocomp.export.facts import Facts
from thermocomp.export.vectors import Readings, replay
from thermocomp.models.mlp import SigmoidNet
from thermocomp.papers.chen1996 import setup as chen
from thermocomp.papers.common import fit_and_freeze
from thermocomp.papers.exported import as_line, run_loop, take_readings, write_loop
from thermocomp.papers.stepwise2017 import setup as stepwise2017
from thermocomp.papers.stepwise2017.redo import claims
from thermocomp.papers.study import tell_nobody
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.program.tables import gather
from thermocomp.virtual.datasets import find_experiment
from thermocomp.virtual.experiments import simulate

BOARD = Path(__file__).parent / "cortexm7"
#: what the emulated board runs; the program talks to this process through its standard input and output
QEMU = ["qemu-system-arm", "-M", "mps2-an500", "-cpu", "cortex-m7", "-display", "none", "-serial", "none"]
QEMU += ["-monitor", "none", "-semihosting-config", "enable=on,target=native", "-kernel"]
TARGET = ["-mcpu=cortex-m7", "-mthumb", "-mfpu=fpv5-d16", "-mfloat-abi=hard", "--specs=rdimon.specs", "-nostartfiles"]
STRICT = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O2"]

pytestmark = pytest.mark.skipif(
    not (shutil.which("arm-none-eabi-gcc") and shutil.which("qemu-system-arm")),
    reason="there is no compiler for a Cortex-M, or no emulator of one",
)


def compile_for_the_board(folder: Path, code: Sequence[str], program: str) -> list[str]:
    """Return the command that runs the program."""
    board = ["-T", str(BOARD / "memory.ld"), str(BOARD / "startup.c")]
    command = ["arm-none-eabi-gcc", *STRICT, *TARGET, *board, *code, "-o", program]
    subprocess.run(command, cwd=folder, check=True)
    return [*QEMU, program]


@pytest.mark.parametrize("precision", [[], ["-DTC_FLOAT"]])
def test_its_vectors_pass_on_a_cortex_m7(tmp_path: Path, precision: list[str]) -> None:
    compensator = Compensator.of([watched_model("z_um"), watched_model("x_um")], Limits(dead_band=0.2))
    texts = write_package(compensator, "mill", Facts("model.json", "", "0", "2026-01-31"))
    for name, text in texts.items():
        (tmp_path / name).write_bytes(text)
    program = compile_for_the_board(tmp_path, [*precision, "tc_mill.c", "tc_mill_test.c", "-lm"], "mill.elf")
    done = subprocess.run(
        program,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        stdin=subprocess.DEVNULL,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert ", 0 wrong;" in done.stdout


def test_the_model_of_stepwise2017_in_a_loop_over_its_online_test(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """T-09: the number that the study states is that of its model on the microcontroller."""
    judged = (stepwise2017.STEPWISE, stepwise2017.LEAST, stepwise2017.PURSUIT)
    methods = {name: stepwise2017.METHODS[name] for name in judged} | {stepwise2017.AVERAGED: "ols"}
    monkeypatch.setattr(stepwise2017, "METHODS", methods)
    found = stepwise2017.compute(0, tell_nobody)
    compensator = Compensator.of([found.models[stepwise2017.STEPWISE]], watching=True)
    readings = take_readings(gather(compensator), found.online)
    assert 1 <= readings.values.shape[1] <= stepwise2017.PAPERS_COUNT
    program = compile_for_the_board(tmp_path, write_loop(compensator, tmp_path), "loop.elf")
    corrections, deviations = run_loop(program, tmp_path, readings)
    left = np.abs(found.online.deviations - deviations).max()
    assert not corrections.any()  # it predicts, and does not correct
    assert left == pytest.approx(found.on_dsp.max_abs, abs=1e-9)
    (claim,) = claims.judged("bounded", found)
    assert claim.ours.startswith(f"{left:.1f} um at most, predicted by ")
    assert claim.holds is bool(left < 5)


def test_chens_net_in_a_closed_loop_with_the_virtual_machine(tmp_path: Path) -> None:
    """C-38: temperatures in, corrections out; what is left is measured when the machine has moved on, at each reading.

    The net of the paper, trained on its five tests (a fifth of the epochs), at the unseen speed of 1250 1/min.
    """
    heat = chen.drift_samples(chen.recordings("chen1996", 0)).only(chen.TEMPERATURES)
    models = fit_and_freeze(SigmoidNet(n_epochs=1000, jobs=1), heat, tuple(chen.DRIFTS)).values()
    compensator = Compensator.of([replace(m, honest_error=ACCEPTED) for m in models])
    program = compile_for_the_board(tmp_path, write_loop(compensator, tmp_path), "loop.elf")
    machine = next(simulate(find_experiment("chen1996-new"), seed=1))
    place = {c.name: k for k, c in enumerate(machine.channels)}
    warm = {name: machine.values[:, place[channel]] for name, channel in chen.SENSORS.items()}
    warm["T5"] = np.mean([warm[name] for name in chen.COLUMN], axis=0)
    rows = np.column_stack([warm[c.name] for c in gather(compensator).channels])
    dt = np.diff(machine.time, prepend=machine.time[:1])
    drift = machine.truth[:, [[c.name for c in machine.displacements].index(d) for d in chen.DRIFTS.values()]]
    in_force, left = np.zeros((len(rows) + 1, 3)), np.empty((len(rows), 3))
    with subprocess.Popen(program, cwd=tmp_path, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as board:
        assert board.stdin is not None
        assert board.stdout is not None
        for k, row in enumerate(rows):
            left[k] = drift[k] + in_force[k]
            board.stdin.write(as_line(dt[k], row))
            board.stdin.flush()
            in_force[k + 1] = np.array(board.stdout.readline().split(), dtype=np.float64)[::2]
        board.stdin.close()
        assert board.wait(60) == 0
    assert np.sqrt(np.mean(left[:, 2] ** 2)) < np.sqrt(np.mean(drift[:, 2] ** 2)) / 4
    said = replay(compensator, gather(compensator), Readings(rows, np.zeros(len(rows)), dt))
    np.testing.assert_allclose(in_force[1:], said.correction, rtol=0, atol=1e-9)

"""A real controller for tests: LinuxCNC with simulated drives, without a display, in a folder of its own."""

import contextlib
import fcntl
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import pytest

#: speeds [mm/s] and accelerations [mm/s2] of X, Y and Z
SPEEDS = (100.0, 80.0, 60.0)
ACCELERATIONS = (1000.0, 800.0, 500.0)
#: the same of A [deg/s, deg/s2]
TURNING, TURNING_UP = 100.0, 1000.0
#: of the servo thread [s]
PERIOD = 0.001
#: the user that LinuxCNC runs as where the tests run as root
NOBODY = 65534

INI = """[EMC]
VERSION = 1.1
MACHINE = test
DEBUG = 0
[DISPLAY]
DISPLAY = ./display
[TASK]
TASK = milltask
CYCLE_TIME = 0.001
[RS274NGC]
PARAMETER_FILE = test.var
[EMCMOT]
EMCMOT = motmod
COMM_TIMEOUT = 4.0
SERVO_PERIOD = 1000000
[EMCIO]
EMCIO = io
CYCLE_TIME = 0.001
TOOL_TABLE = test.tbl
[HAL]
HALFILE = test.hal
[TRAJ]
COORDINATES = {spaced}
LINEAR_UNITS = mm
ANGULAR_UNITS = degree
MAX_LINEAR_VELOCITY = 500
[KINS]
KINEMATICS = trivkins coordinates={axes}
JOINTS = {count}
"""
AXIS = """[AXIS_{name}]
MIN_LIMIT = -{limit}
MAX_LIMIT = {limit}
MAX_VELOCITY = {speed}
MAX_ACCELERATION = {acceleration}
[JOINT_{number}]
TYPE = {kind}
HOME_SEQUENCE = 0
MIN_LIMIT = -{limit}
MAX_LIMIT = {limit}
MAX_VELOCITY = {speed}
MAX_ACCELERATION = {acceleration}
FERROR = 5
MIN_FERROR = 5
"""
HAL = """loadrt trivkins coordinates={axes}
loadrt motmod servo_period_nsec=1000000 num_joints={count}
loadrt sampler depth=16000 cfg=ssb
addf motion-command-handler servo-thread
addf motion-controller servo-thread
addf sampler.0 servo-thread
net estop iocontrol.0.user-enable-out => iocontrol.0.emc-enable-in
net prepare iocontrol.0.tool-prepare => iocontrol.0.tool-prepared
net change iocontrol.0.tool-change => iocontrol.0.tool-changed
newsig program s32
net program => sampler.0.pin.0
net line motion.program-line => sampler.0.pin.1
net still motion.in-position => sampler.0.pin.2
"""
LOOP = "net drive-{number} joint.{number}.motor-pos-cmd => joint.{number}.motor-pos-fb\n"


class Run(NamedTuple):
    """How a program ran, in periods of the servo thread: what the machine was told, however busy the computer was."""

    seconds: float  #: from its first move to its last
    began: dict[int, float]  #: by number of the line: when its motion began first [s]


def run(programs: Mapping[str, str], seconds: float, rotary: bool = False) -> dict[str, Run]:
    """Run programs one after the other, each from X0 Y0 Z0 and A0.

    Time is counted in periods of the servo thread, in which the planner computes. On a busy computer these come late,
    and a clock on the wall would tell more.

    Parameters
    ----------
    programs : mapping of str to str
        Texts by name; they begin and end with a move.
    seconds : float
        What they may take on the wall [s].
    rotary : bool
        The machine has an axis A.

    Returns
    -------
    dict of str to Run
    """
    with only_one() as folder:
        return _run(programs, seconds, folder, rotary)


@contextlib.contextmanager
def only_one() -> Iterator[Path]:
    """Give a folder to run in, while no other test runs a LinuxCNC: there can be only one on a computer."""
    if shutil.which("linuxcnc") is None:
        pytest.skip("LinuxCNC is not installed (Debian package linuxcnc-uspace)")
    folder = Path(tempfile.mkdtemp(prefix="linuxcnc-"))
    try:
        with (Path(tempfile.gettempdir()) / f"linuxcnc-test-{os.getuid()}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def hand_over(folder: Path) -> None:
    """Give a folder to the user that `command` runs LinuxCNC as."""
    if os.getuid() == 0:
        for path in (folder, *folder.iterdir()):
            os.chown(path, NOBODY, NOBODY)


def command(folder: Path) -> list[str]:
    """Return what runs the LinuxCNC of a folder, where it has its home."""
    words = ["env", "-i", "PATH=/usr/bin:/bin:/usr/sbin:/sbin", f"HOME={folder}", "USER=nobody", "LANG=C.UTF-8"]
    words += ["TERM=dumb", "linuxcnc", "-r", "test.ini"]
    if os.getuid() == 0:  # LinuxCNC refuses to run as root
        return ["setpriv", f"--reuid={NOBODY}", f"--regid={NOBODY}", "--clear-groups", *words]
    return words


def _run(programs: Mapping[str, str], seconds: float, folder: Path, rotary: bool) -> dict[str, Run]:
    axes = "XYZA" if rotary else "XYZ"
    named = {"axes": axes, "spaced": " ".join(axes), "count": len(axes)}
    speeds, ups = (*SPEEDS, TURNING), (*ACCELERATIONS, TURNING_UP)
    ini = INI.format(**named) + "".join(
        AXIS.format(
            name=name,
            number=k,
            speed=speeds[k],
            acceleration=ups[k],
            kind="ANGULAR" if name == "A" else "LINEAR",
            limit=9999 if name == "A" else 500,
        )
        for k, name in enumerate(axes)
    )
    hal = HAL.format(**named) + "".join(LOOP.format(number=k) for k in range(len(axes)))
    for name, text in (
        ("test.ini", ini),
        ("test.hal", hal),
        ("test.var", ""),
        ("test.tbl", "T1 P1 D6 Z0\nT2 P2 D6 Z0\n"),
    ):
        (folder / name).write_text(text, encoding="ascii")
    for name, text in programs.items():
        (folder / f"{name}.ngc").write_text(text, encoding="ascii")
    shutil.copy(Path(__file__).with_name("linuxcncdisplay.py"), folder)
    display = folder / "display"
    files = " ".join(f'"{folder / name}.ngc"' for name in programs)
    display.write_text(f"#!/bin/sh\nexec /usr/bin/python3 linuxcncdisplay.py {seconds} {files}\n", encoding="ascii")
    display.chmod(0o755)
    hand_over(folder)
    for _ in range(20):
        told = _start(command(folder), folder, seconds)
        if "could not open shared memory" not in told:
            break
        time.sleep(1.0)  # an interpreter of another user is just running: they share memory
    if "DONE" not in told:
        raise RuntimeError(f"LinuxCNC failed:\n{told}")
    found = _read(folder / "samples.txt", len(programs))
    return dict(zip(programs, found, strict=True))


def _start(words: list[str], folder: Path, seconds: float) -> str:
    """Run LinuxCNC, and return what it told."""
    with (folder / "log").open("w+", encoding="utf-8", errors="replace") as log:
        process = subprocess.Popen(words, cwd=folder, stdin=subprocess.DEVNULL, stdout=log, stderr=log)
        try:
            process.wait(seconds + 30.0)
        finally:
            if process.poll() is None:
                process.terminate()
                process.wait(30.0)
        log.seek(0)
        return log.read()


def _read(path: Path, n: int) -> list[Run]:
    """Return how the programs ran, from what the sampler wrote."""
    began: list[dict[int, int]] = [{} for _ in range(n)]
    first, last = [0] * n, [0] * n
    expected = None
    for row in path.read_text(encoding="ascii").splitlines():
        number, program, line, still = (int(v) for v in row.split())
        if expected not in (None, number):
            raise RuntimeError(f"the sampler lost {path.name} {expected} to {number}")
        expected = number + 1
        if program and not still:
            k = program - 1
            first[k] = first[k] or number
            last[k] = number
            began[k].setdefault(line, number)
    return [
        Run((last[k] - first[k] + 1) * PERIOD, {line: (at - first[k]) * PERIOD for line, at in began[k].items()})
        for k in range(n)
    ]


if __name__ == "__main__":
    for name, ran in run({Path(p).name: Path(p).read_text(encoding="ascii") for p in sys.argv[1:]}, 120.0).items():
        print(name, ran.seconds, ran.began)

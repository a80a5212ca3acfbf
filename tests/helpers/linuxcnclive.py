"""A real LinuxCNC that is corrected: set up by ``thermocomp linuxcnc setup``, told by a test what to do, traced."""

import contextlib
import json
import os
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import linuxcncrun
import numpy as np
from numpy.typing import NDArray

from thermocomp.live.adapters.linuxcnc.halsetup import HalSettings, Pattern, set_up

#: of the servo thread [s]
PERIOD = 0.001
AXES = "XZ"
LIMIT = 120.0  # of the travel, both ways [mm]

HAL = """loadrt trivkins coordinates=XYZ
loadrt motmod servo_period_nsec=1000000 num_joints=3
loadrt sum2 count=1
addf motion-command-handler servo-thread
addf motion-controller servo-thread
net estop iocontrol.0.user-enable-out => iocontrol.0.emc-enable-in
net prepare iocontrol.0.tool-prepare => iocontrol.0.tool-prepared
net powered motion.motion-enabled
net change iocontrol.0.tool-change => iocontrol.0.tool-changed
"""
#: memory that the processes of a LinuxCNC share: of HAL, its sampler, its planner
SHARED = (0x48414C32, 0x48484C34, 0x48534130, 100)
#: what is traced of each axis: what the drive is told, what is commanded, and offset and slope in force
TRACED = ("{drive}", "tc-axis-{a}-pos-cmd", "tc-{a}-offset-now", "traced-{a}-slope")
#: the planner's positions reach a drive through a cubic spline, which is late: shares of the last three periods but one
SPLINE = (1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0)


class Trace(NamedTuple):
    """What was traced, a row per period of the servo thread."""

    period: NDArray[np.int64]
    on: NDArray[np.bool_]  #: a correction can be in force
    drive: dict[str, NDArray[np.float64]]  #: by axis [mm]
    commanded: dict[str, NDArray[np.float64]]  #: [mm]
    offset: dict[str, NDArray[np.float64]]  #: [um]
    slope: dict[str, NDArray[np.float64]]  #: [um/m]

    def added(self, axis: str) -> NDArray[np.float64]:
        """Return what the drive is told more than commanded [um]; 0 in the first periods, of which nothing is known."""
        commanded = self.commanded[axis]
        late = sum(share * commanded[3 - k : -k] for k, share in enumerate(SPLINE, 1))
        return np.concatenate([np.zeros(3), 1e3 * (self.drive[axis][3:] - late)])

    def demanded(self, axis: str) -> NDArray[np.float64]:
        """Return the correction that the line in force has at the commanded position [um]."""
        return self.offset[axis] + 1e-3 * self.slope[axis] * self.commanded[axis]

    def steps(self, axis: str) -> NDArray[np.float64]:
        """Return by how much the line in force moves within each period, at the end that moves more [um]."""
        ends = [self.offset[axis] + 1e-3 * self.slope[axis] * p for p in (-LIMIT, LIMIT)]
        found: NDArray[np.float64] = np.abs(np.diff(ends)).max(axis=0)
        return found


class Live:
    """A LinuxCNC that runs.

    Parameters
    ----------
    folder : Path
    """

    def __init__(self, folder: Path) -> None:
        self.folder, self.socket = folder, folder / "thermocomp.sock"
        self._display: socket.socket | None = None

    def start(self) -> None:
        """Start it, and wait until it can be told what to do."""
        (self.folder / "display.sock").unlink(missing_ok=True)
        command = linuxcncrun.command(self.folder)
        for _ in range(20):
            log = (self.folder / "log").open("w")
            with log:
                self._process = subprocess.Popen(
                    command, cwd=self.folder, stdin=subprocess.DEVNULL, stdout=log, stderr=log
                )
            end = time.monotonic() + 30.0
            while self._process.poll() is None and time.monotonic() < end:
                display = socket.socket(socket.AF_UNIX)
                try:
                    display.connect(str(self.folder / "display.sock"))
                except OSError:
                    display.close()
                    time.sleep(0.02)
                    continue
                display.settimeout(300.0)  # a component that was killed while it had HAL's lock stops it for ever
                self._display, self._file = display, display.makefile("rw")
                return
            if "could not open shared memory" not in self.told():
                break
            time.sleep(1.0)  # an interpreter of another user is just running: they share memory
        raise RuntimeError(f"LinuxCNC does not start:\n{self.told()}")

    def told(self) -> str:
        """Return what it printed."""
        return (self.folder / "log").read_text(encoding="utf-8", errors="replace")

    def do(self, name: str, *arguments: Any) -> Any:
        """Let the display do something."""
        self._file.write(json.dumps([name, *arguments]) + "\n")
        self._file.flush()
        answer, error = json.loads(self._file.readline())
        if error:
            raise RuntimeError(f"{name} {arguments}: {error}\n{self.told()}")
        return answer

    def get(self, name: str) -> float:
        """Return a value of the HAL."""
        return float(self.do("get", name)[0])

    def ready(self) -> None:
        """Switch it on and home it."""
        self.do("on")
        self.do("home")

    def pids(self, word: str = "") -> list[int]:
        """Return its processes, those with a word in their command line."""
        found = []
        for entry in Path("/proc").iterdir():
            with contextlib.suppress(OSError, ValueError):
                if entry.joinpath("cwd").readlink() == self.folder:
                    line = entry.joinpath("cmdline").read_bytes().decode(errors="replace").replace("\0", " ")
                    if word in line:
                        found.append(int(entry.name))
        return found

    def component(self) -> int:
        """Return the process of the component."""
        return self.pids("--once")[0]

    def kill(self) -> None:
        """Kill all of it at once."""
        self._hang_up()
        while pids := self.pids():
            for pid in pids:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(0.1)
        for key in SHARED:  # it would be found by the next one as it was left
            subprocess.run(["ipcrm", "-M", hex(key)], stderr=subprocess.DEVNULL, check=False)

    def stop(self) -> None:
        """End it."""
        self._hang_up()
        try:
            self._process.wait(20.0)
        except subprocess.TimeoutExpired:
            pass
        finally:
            self.kill()

    def _hang_up(self) -> None:
        if self._display is not None:
            self._file.close()
            self._display.close()
            self._display = None

    def trace(self, file: str = "trace") -> Trace:
        """Return what was traced, without a gap."""
        rows = np.loadtxt(self.folder / file, ndmin=2)
        period = rows[:, 0].astype(np.int64)
        if np.any(np.diff(period) != 1):
            raise RuntimeError("the sampler lost rows")
        parts = rows[:, 2:].T.reshape(len(AXES), len(TRACED), -1)
        named = [dict(zip(AXES, part, strict=True)) for part in parts.transpose(1, 0, 2)]
        drive, commanded, offset, slope = named
        um = {a: 1e3 * v for a, v in offset.items()}
        return Trace(period, rows[:, 1] != 0, drive, commanded, um, slope)


@contextlib.contextmanager
def live(
    settings: HalSettings, programs: Mapping[str, str] | None = None, ratio: str = "OFFSET_AV_RATIO = 0.1\n"
) -> Iterator[Live]:
    """Run a LinuxCNC that is corrected.

    Parameters
    ----------
    settings : HalSettings
    programs : mapping of str to str, optional
        Texts by name.
    ratio : str
        Line of the INI, in force when it runs; the setup sees a right one.
    """
    with linuxcncrun.only_one() as folder:
        _lay_out(folder, settings, ratio, programs or {})
        linuxcncrun.hand_over(folder)
        machine = Live(folder)
        try:
            machine.start()
            yield machine
        finally:
            machine.stop()


def _lay_out(folder: Path, settings: HalSettings, ratio: str, programs: Mapping[str, str]) -> None:
    right = "OFFSET_AV_RATIO = 0.1\n"
    ini = linuxcncrun.INI.format(axes="XYZ", spaced="X Y Z", count=3)
    for k, name in enumerate("XYZ"):
        axis = linuxcncrun.AXIS.format(
            name=name,
            number=k,
            speed=linuxcncrun.SPEEDS[k],
            acceleration=linuxcncrun.ACCELERATIONS[k],
            kind="LINEAR",
            limit=LIMIT,
        )
        ini += axis.replace("[JOINT", f"{right}[JOINT")
    hal = HAL + "".join(linuxcncrun.LOOP.format(number=k) for k in range(3))
    for name, text in (("test.ini", ini), ("test.hal", hal), ("test.var", ""), ("test.tbl", "T1 P1 D6 Z0\n")):
        (folder / name).write_text(text, encoding="ascii")
    for todo in set_up(folder / "test.ini", folder, settings).todo:
        if "already loads sum2" in todo:  # done as it says
            hal = hal.replace("loadrt sum2 count=1", todo.partition("change it to: ")[2])
    (folder / "test.hal").write_text(hal, encoding="ascii")
    ini = ini.replace("HALFILE = test.hal\n", "HALFILE = test.hal\nHALFILE = thermocomp.hal\nHALFILE = trace.hal\n")
    (folder / "test.ini").write_text(ini.replace(right, ratio), encoding="ascii")
    (folder / "trace.hal").write_text(_tracing(settings.pattern), encoding="ascii")
    for name, text in programs.items():
        (folder / f"{name}.ngc").write_text(text, encoding="ascii")
    shutil.copy(Path(__file__).with_name("linuxcnclivedisplay.py"), folder)
    display = folder / "display"
    display.write_text("#!/bin/sh\nexec /usr/bin/python3 linuxcnclivedisplay.py\n", encoding="ascii")
    display.chmod(0o755)


def _tracing(pattern: Pattern) -> str:
    lines = [f"loadrt sampler depth=8000 cfg=b{'f' * (len(TRACED) * len(AXES))}", "net tc-on => sampler.0.pin.0"]
    lines.append("setp sampler.0.enable 0")
    pins = iter(range(1, 100))
    lines.append(
        f"loadrt scale names={','.join(f'traced.{a.lower()}' for a in AXES)}"
    )  # it is written with six decimals
    for a in AXES.lower():
        lines += [f"net tc-{a}-slope-now => traced.{a}.in", f"net traced-{a}-slope traced.{a}.out"]
        lines += [f"setp traced.{a}.gain 1e6", f"addf traced.{a} servo-thread"]
    # a probe that touches when the drive of Z is told to go below -100.5
    lines += ["loadrt comp names=traced.touch", "loadrt not names=traced.touched", "setp traced.touch.in0 -100.5"]
    lines += ["setp traced.touch.hyst 0", "net traced-touch traced.touch.out => traced.touched.in"]
    lines += ["net traced-touched traced.touched.out => motion.probe-input"]
    lines += ["addf traced.touch servo-thread", "addf traced.touched servo-thread"]
    lines.append(f"net {'drive-2' if pattern == 'offset' else 'tc-z-drive'} => traced.touch.in1")
    for axis in AXES:
        drive = f"drive-{'XYZ'.index(axis)}" if pattern == "offset" else f"tc-{axis.lower()}-drive"
        for signal_name in TRACED:
            lines.append(f"net {signal_name.format(a=axis.lower(), drive=drive)} => sampler.0.pin.{next(pins)}")
    return "\n".join([*lines, "addf sampler.0 servo-thread"]) + "\n"


if __name__ == "__main__":
    folder = Path(tempfile.mkdtemp())
    _lay_out(folder, HalSettings(axes=AXES), "OFFSET_AV_RATIO = 0.1\n", {})
    print((folder / "thermocomp.hal").read_text())

"""A real LinuxCNC that an export corrects: its component built and installed by halcompile, as its page says."""

import contextlib
import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import linuxcncrun
import pytest
from linuxcnclive import HAL, LIMIT, Live

#: where LinuxCNC looks for what `loadrt` loads
MODULES = Path("/usr/lib/linuxcnc/modules")


@contextlib.contextmanager
def installed(folder: Path) -> Iterator[None]:
    """Build the component of a folder, and have it where LinuxCNC loads it from, for a while."""
    if shutil.which("halcompile") is None:
        pytest.skip("there is no halcompile (Debian package linuxcnc-uspace-dev)")
    root = [] if os.access(MODULES, os.W_OK) else ["sudo", "-n"]
    if root and (shutil.which("sudo") is None or subprocess.run([*root, "true"], check=False).returncode):
        pytest.skip(f"who runs the tests may not write into {MODULES}, where halcompile installs")
    comp = next(folder.glob("*.comp"))
    try:
        subprocess.run([*root, "halcompile", "--install", comp.name], cwd=folder, check=True)
        yield
    finally:
        subprocess.run([*root, "rm", "-f", str(MODULES / f"{comp.stem}.so")], check=True)


def fill_in(hal: str) -> str:
    """Return HAL of an export whose values come from nothing but its signals, which `halcmd sets` sets."""
    lines = [line.removeprefix("#") if "SOURCE" in line and "good" not in line else line for line in hal.splitlines()]
    lines = [line.removeprefix("#") if line.endswith(".told-cold 1") else line for line in lines]
    return "\n".join(line.replace(" SOURCE =>", " =>") for line in lines) + "\n"


@contextlib.contextmanager
def live_export(texts: dict[str, bytes]) -> Iterator[Live]:
    """Run a LinuxCNC with the files of an export.

    Parameters
    ----------
    texts : dict of str to bytes
        Files by their names.
    """
    with linuxcncrun.only_one() as folder:
        for file, text in texts.items():
            (folder / file).write_bytes(text)
        with installed(folder):
            _lay_out(folder, next(f for f in texts if f.endswith(".hal")))
            linuxcncrun.hand_over(folder)
            machine = Live(folder)
            try:
                machine.start()
                yield machine
            finally:
                machine.stop()


def _lay_out(folder: Path, export: str) -> None:
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
        ini += axis.replace("[JOINT", "OFFSET_AV_RATIO = 0.1\n[JOINT")
    ini = ini.replace("HALFILE = test.hal\n", f"HALFILE = test.hal\nHALFILE = {export}\n")
    hal = HAL + "".join(linuxcncrun.LOOP.format(number=k) for k in range(3))
    filled = fill_in((folder / export).read_text(encoding="ascii"))
    # the machine of the tests has this pin in a signal already, as the file warns
    filled = filled.replace(f"net {Path(export).stem.replace('_', '-')}-hal-enabled", "net powered")
    for name, text in (("test.ini", ini), ("test.hal", hal), ("test.var", ""), ("test.tbl", "T1 P1 D6 Z0\n")):
        (folder / name).write_text(text, encoding="ascii")
    (folder / export).write_text(filled, encoding="ascii")
    shutil.copy(Path(__file__).with_name("linuxcnclivedisplay.py"), folder)
    display = folder / "display"
    display.write_text("#!/bin/sh\nexec /usr/bin/python3 linuxcnclivedisplay.py\n", encoding="ascii")
    display.chmod(0o755)

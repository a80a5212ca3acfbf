"""A component of LinuxCNC's HAL, preprocessed by the real halcompile and run in this process without LinuxCNC.

Time is what the caller says, so that hours pass in a second. What is around the component is a stand-in for HAL: pins
by their names, and one function.
"""

import ctypes
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

#: where Debian's linuxcnc-uspace-dev has its headers
HEADERS = Path("/usr/include/linuxcnc")
STRICT = (
    "-Wall",
    "-Wextra",
    "-Werror",
    "-Wno-unused-parameter",
    "-O2",
    "-fsanitize=undefined",
    "-fno-sanitize-recover",
)
#: of LinuxCNC's own builds
HOUSE = ("-DRTAPI", "-DUSPACE", "-DSIM", "-D_GNU_SOURCE", "-D__MODULE__", f"-I{HEADERS}")
TYPES: dict[str, Any] = {
    "float": ctypes.c_double,
    "bit": ctypes.c_bool,
    "u32": ctypes.c_uint32,
    "s32": ctypes.c_int32,
}

needs_halcompile = pytest.mark.skipif(
    shutil.which("halcompile") is None or shutil.which("gcc") is None,
    reason="there is no halcompile (Debian package linuxcnc-uspace-dev), or no gcc",
)

_STAND = """
#include "rtapi.h"
#include "hal.h"
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static struct { char name[HAL_NAME_LEN + 1]; void *at; } pins[1000];
static int count;
static void (*function)(void *, long);
static void *instance;

static int add(void **at, const char *format, va_list names)
{
    if (vsnprintf(pins[count].name, sizeof pins->name, format, names) > HAL_NAME_LEN) return -1;
    *at = pins[count++].at = calloc(1, 8);
    return 0;
}

#define PIN(type) \\
int hal_pin_##type##_newf(hal_pin_dir_t dir, hal_##type##_t **at, int id, const char *format, ...) \\
{ va_list names; int r; va_start(names, format); r = add((void **)at, format, names); va_end(names); return r; }
PIN(float) PIN(bit) PIN(u32) PIN(s32)

int hal_param_float_newf(hal_param_dir_t dir, hal_float_t *at, int id, const char *format, ...)
{
    va_list names;
    va_start(names, format);
    vsnprintf(pins[count].name, sizeof pins->name, format, names);
    va_end(names);
    pins[count++].at = (void *)at;
    return 0;
}
int hal_init(const char *name) { return 1; }
int hal_ready(int id) { return 0; }
int hal_exit(int id) { return 0; }
void *hal_malloc(long size) { return malloc(size); }
int rtapi_snprintf(char *into, unsigned long size, const char *format, ...)
{ va_list rest; int r; va_start(rest, format); r = vsnprintf(into, size, format, rest); va_end(rest); return r; }
int hal_export_funct(const char *name, void (*f)(void *, long), void *arg, int fp, int re, int id)
{ function = f; instance = arg; return 0; }

void *find(const char *name)
{
    int k;
    for (k = 0; k < count; k++) if (!strcmp(pins[k].name, name)) return pins[k].at;
    return NULL;
}
long later;
time_t time(time_t *at)
{
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    if (at) *at = now.tv_sec + later;
    return now.tv_sec + later;
}
void run(int periods, long period) { while (periods--) function(instance, period); }
"""


class HalStand:
    """A component of an export.

    Parameters
    ----------
    folder : Path
        With its files; what is made of them goes there, too.
    state_file : str
        Parameter of the component; empty: none.
    ago : int
        So many seconds more have passed since the file was written.
    """

    _count = 0

    def __init__(self, folder: Path, state_file: str = "", ago: int = 0) -> None:
        comp = next(folder.glob("*.comp"))
        subprocess.run(["halcompile", "--preprocess", comp.name], cwd=folder, check=True)
        (folder / "stand.c").write_text(_STAND, encoding="ascii")
        common = ["gcc", "-shared", "-fPIC", *HOUSE, "-I."]
        subprocess.run([*common, *STRICT, "-c", f"{comp.stem}.c", "-o", "made.o"], cwd=folder, check=True)
        HalStand._count += 1  # a library is loaded once by its name
        made = folder / f"{comp.stem}{HalStand._count}.so"
        # its own time(), not that of the C library of this process
        line = [*common, "stand.c", "made.o", "-fsanitize=undefined", "-Wl,-Bsymbolic", "-lm", "-o", made.name]
        subprocess.run(line, cwd=folder, check=True)
        self._library = ctypes.CDLL(str(made))
        self._file = ctypes.create_string_buffer(state_file.encode())
        if state_file:
            at = ctypes.c_void_p.in_dll(self._library, "rtapi_info_address_state_file").value
            assert at
            ctypes.c_void_p.from_address(at).value = ctypes.addressof(self._file)
        ctypes.c_long.in_dll(self._library, "later").value = ago
        self._library.find.restype = ctypes.c_void_p
        self._name = comp.stem.replace("_", "-")
        assert self._library.rtapi_app_main() == 0
        self._types = _types(comp.read_text(encoding="ascii"))

    def __getitem__(self, pin: str) -> Any:
        return self._at(pin).value

    def __setitem__(self, pin: str, value: float) -> None:
        self._at(pin).value = value

    def _at(self, pin: str) -> Any:
        at = self._library.find(f"{self._name}.{pin}".encode())
        assert at, f"no pin {pin}"
        kind = self._types.get(pin) or self._types[pin.rstrip("0123456789") + "#"]
        return TYPES[kind].from_address(at)

    def exit(self) -> None:
        """End as LinuxCNC does when it unloads the component."""
        self._library.rtapi_app_exit()

    def run(self, periods: int, period: int = 1_000_000) -> None:
        """Let periods of the servo thread [ns] pass."""
        self._library.run(periods, ctypes.c_long(period))


def _types(text: str) -> dict[str, str]:
    found = {}
    for line in text.splitlines():
        words = line.split()
        if words[:1] in (["pin"], ["param"]):
            found[words[3].partition("[")[0].rstrip(";")] = words[2]
    return found

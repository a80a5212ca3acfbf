"""Redirection of calls in a loaded C++ library to Python functions, by its global offset table (Linux, 64 bit).

Part of the script `_rs274_child.py`: standard library only.
"""

import ctypes
import mmap
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

RELOCATIONS = (6, 7, 1025, 1026)  # GLOB_DAT and JUMP_SLOT of x86-64 and of aarch64
P = ctypes.c_void_p


def slots(library: str, names: set[str]) -> dict[str, list[int]]:
    """Return the addresses of the entries through which a loaded library calls functions with these mangled names."""
    found = None
    for line in Path("/proc/self/maps").read_text(encoding="utf-8").splitlines():
        fields = line.split()
        if len(fields) >= 6 and library in Path(fields[5]).name and int(fields[2], 16) == 0:
            found = int(fields[0].split("-")[0], 16), fields[5]
            break
    if found is None:
        raise RuntimeError(f"{library} is not loaded")
    base, path = found
    data = Path(path).read_bytes()
    if data[:6] != b"\x7fELF\x02\x01":
        raise RuntimeError(f"{path} is not a 64-bit little-endian library")
    start, size, count = (struct.unpack_from("<Q", data, 32)[0], *struct.unpack_from("<HH", data, 54))
    segments = [
        struct.unpack_from("<IIQQQQ", data, start + i * size) for i in range(count)
    ]  # type, flags, offset, vaddr

    def at(address: int) -> int:
        for kind, _, offset, virtual, _, length in segments:
            if kind == 1 and virtual <= address < virtual + length:
                return int(offset + address - virtual)
        raise RuntimeError(f"{path}: address {address:#x} is in no segment")

    dynamic = next(segment for segment in segments if segment[0] == 2)
    tags = dict(struct.iter_unpack("<QQ", data[dynamic[2] : dynamic[2] + dynamic[5]]))
    symbols, strings = at(tags[6]), at(tags[5])
    result: dict[str, list[int]] = {}
    for table, length in ((7, 8), (23, 2)):  # DT_RELA and DT_JMPREL with their sizes
        if table in tags:
            first = at(tags[table])
            for offset, info, _ in struct.iter_unpack("<QQq", data[first : first + tags[length]]):
                if info & 0xFFFFFFFF in RELOCATIONS:
                    name = strings + struct.unpack_from("<I", data, symbols + 24 * (info >> 32))[0]
                    symbol = data[name : data.index(b"\0", name)].decode("ascii", "replace")
                    if symbol in names:
                        result.setdefault(symbol, []).append(base + offset)
    return result


class Hooks:
    """Redirection of calls of a loaded library to functions of this script."""

    def __init__(self) -> None:
        self.kept: list[Any] = []  # ctypes does not keep a callback alive
        self.failure: BaseException | None = None
        self.protect = ctypes.CDLL(None, use_errno=True).mprotect
        self.protect.argtypes = (P, ctypes.c_size_t, ctypes.c_int)

    def turn(self, library: str, functions: dict[str, tuple[Callable[..., Any], tuple[Any, ...]]]) -> dict[str, Any]:
        """Replace the functions that have these mangled names; return the originals.

        A replacement is a pair: the function, and the types of its result and arguments.
        """
        found = slots(library, set(functions))
        missing = sorted(set(functions) - set(found))
        if missing:
            raise RuntimeError(f"{library} has an unsupported version: it does not call {', '.join(missing)}")
        before = {}
        for name, (function, types) in functions.items():
            callback = ctypes.CFUNCTYPE(*types)(self.guarded(function))
            self.kept.append(callback)
            for address in found[name]:
                page = address & -mmap.PAGESIZE
                if self.protect(page, mmap.PAGESIZE, 3):
                    raise OSError(ctypes.get_errno(), "mprotect")
                slot = ctypes.c_void_p.from_address(address)
                before[name] = ctypes.PYFUNCTYPE(*types)(slot.value or 0)  # holds the GIL
                slot.value = ctypes.cast(callback, P).value
        return before

    def guarded(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """Wrap a function to store its first error: an error raised in a callback would only be printed."""

        def call(*numbers: Any) -> Any:
            try:
                return function(*numbers)
            except BaseException as error:  # noqa: BLE001
                self.failure = self.failure or error
                return 0

        return call

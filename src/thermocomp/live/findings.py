"""Checks of the files named in a configuration: all faults that would prevent the start of the service, at once."""

import os
import re
import tempfile
from collections import Counter, deque
from collections.abc import Iterator
from pathlib import Path

from thermocomp.core.alone import alone
from thermocomp.core.exceptions import InputError
from thermocomp.live.adapters.linuxcnc.halsetup import HAL_NAME, LONGEST
from thermocomp.live.adapters.plain import read_rows
from thermocomp.live.adapters.sections import FileOut, LinuxCncOut, ReplayIn, SimulatedIn
from thermocomp.live.config import Page, ServiceSettings
from thermocomp.live.page import web

#: maximum length of a file name [bytes]
_LONG = 255


def find_faults(settings: ServiceSettings) -> Iterator[str]:
    """Yield faults of files: those that cannot be read, and those that cannot be written."""
    config, folder = settings
    read = [*config.models, *([config.machine.file] if config.machine else [])]
    read += [s.experiment for s in config.sources if isinstance(s, SimulatedIn) and s.experiment.endswith(".toml")]
    read += [config.page.token_file] if config.page and config.page.token_file else []
    replayed = [s.file for s in config.sources if isinstance(s, ReplayIn)]
    for name in (*read, *replayed):
        if why := _unreadable(folder / name, recording=name in replayed):
            yield f"{folder / name}: {why}"
    kept = [name for name in (config.state, config.journal.file if config.journal else "") if name]
    locks, sent = [f"{name}.lock" for name in kept], [s.file for s in config.sinks if isinstance(s, FileOut)]
    written = [*kept, *locks, *sent]
    names = Counter((folder / name).resolve() for name in (*read, *replayed, *written))
    if config.journal:
        journal = folder / config.journal.file
        parts = re.compile(rf"{re.escape(journal.stem)}\.\d+{re.escape(journal.suffix)}(-wal|-shm)?")
        for path in (folder / name for name in sent):
            if path.parent.resolve() == journal.parent.resolve() and parts.fullmatch(path.name):
                yield (
                    f"{path}: the file may be a part of the journal {journal} and would be overwritten; name "
                    "another file"
                )
    for name in dict.fromkeys(written):
        if name in locks and not (folder / name).parent.is_dir():  # reported for the file itself
            continue
        if why := _unwritable(folder / name):
            yield f"{folder / name}: {why}"
        if names[(folder / name).resolve()] > 1:
            yield f"{folder / name}: this file is named more than once and would be overwritten; name another file"
    for one in config.sinks:
        if isinstance(one, LinuxCncOut) and len(os.fsencode(folder / one.socket)) > LONGEST:
            yield f"{folder / one.socket}: the path of a socket has at most {LONGEST} bytes; choose a shorter one"


def find_faults_now(settings: ServiceSettings, page: Page | None) -> Iterator[str]:
    """Yield other faults found now that would prevent the start of the service or the operation of a link."""
    config, folder = settings
    for source in config.sources:
        if isinstance(source, ReplayIn) and not _unreadable(folder / source.file, recording=True):
            try:
                deque(read_rows(folder / source.file), maxlen=0)
            except InputError as e:
                yield str(e)
    for sink in config.sinks:
        if isinstance(sink, LinuxCncOut):
            yield from _faults_of_setup(folder / sink.socket, {a.lower() for a in sink.axes.values()})
    if page is not None:
        if page.token_file and (folder / page.token_file).is_file():
            try:
                web.read_token(folder / page.token_file)
            except InputError as e:
                yield str(e)
        try:
            web.listen(page.host, 0 if runs_now(settings) else page.port).close()
        except InputError as e:
            yield f"{e} (as found now)"


def runs_now(settings: ServiceSettings) -> bool:
    """Return whether the service of this configuration is running: its port is then in use."""
    config, folder = settings
    for name in (config.state, config.journal.file if config.journal else ""):
        if name and (folder / f"{name}.lock").exists():  # without a lock file no service is running
            try:
                with alone(folder / name):
                    pass
            except InputError:
                return True
    return False


def _unreadable(path: Path, *, recording: bool) -> str:
    if not path.is_file():
        return "this is a folder; name a file" if path.is_dir() else "no such file"
    if not os.access(path, os.R_OK):
        return "this user has no permission to read the file"
    try:
        if recording:
            read_rows(path).close()
    except InputError as e:
        return str(e).removeprefix(f"{path}: ")
    return ""


def _unwritable(path: Path) -> str:
    if len(os.fsencode(path.name)) > _LONG:
        return f"the name has {len(os.fsencode(path.name))} bytes; at most {_LONG} are allowed"
    if path.exists() and not path.is_file():
        return f"this is {'a folder' if path.is_dir() else 'a pipe or a device'}; name a file"
    if not path.parent.is_dir():
        return f"there is no folder {path.parent}"
    try:
        with tempfile.TemporaryFile(dir=path.parent):
            pass
    except OSError as e:
        return f"no file can be created in the folder {path.parent}: {e.strerror}"
    return "the file is read-only" if path.exists() and not os.access(path, os.W_OK) else ""


def _faults_of_setup(socket: Path, axes: set[str]) -> Iterator[str]:
    """Yield the faults in the setup of LinuxCNC."""
    hal = socket.with_name(HAL_NAME)
    do = "run 'thermocomp linuxcnc setup': its output names the socket to which the service connects"
    if socket.exists() and not socket.is_socket():
        yield f"{socket}: this is not a socket; {do}"
    elif hal.is_file():
        there = set(re.findall(r"--axis (\w),", hal.read_text(encoding="utf-8", errors="replace")))
        if missing := axes - there:
            lacking = ", ".join(sorted(missing)).upper()
            yield (
                f"{hal}: the file has no correction of axis {lacking}; run 'thermocomp linuxcnc setup' again "
                "with --axes"
            )
    elif not socket.exists():
        yield f"{socket}: LinuxCNC is not set up there: there is no {HAL_NAME}; {do}"

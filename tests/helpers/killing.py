"""Kills runs that write, of all kinds, and tells what they leave: ``python killing.py FOLDER KILLS SEED``.

A third of the runs is killed at a moment by the clock, the others at a call to the system by its number or soon after:
moments in which files come into being are short. Forks make it quick, so it is a process of its own.
"""

import json
import os
import random
import signal
import sys
import time
import traceback
from collections import Counter
from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import Any

from allwriters import WRITERS, Writer

from thermocomp.files.draft import write_text
from thermocomp.files.scratch import is_scratch

#: of a run: more versions than it lives for
_ENOUGH = 1000
HOW = ("clock", "at a call", "soon after a call")
_WHOLE = "whole " * 50_000


def _add(folder: Path, version: int) -> None:
    """Write a file of a name that is not there yet."""
    names = (folder / f"new{k}.txt" for k in count())
    write_text(f"{_WHOLE}{version}", next(n for n in names if not n.exists()), overwrite=False)


KINDS = {**WRITERS, "new files": Writer(_add, ("new.txt",), "new.txt")}


def contents(folder: Path) -> dict[str, bytes]:
    """The files of a folder by name; of new ones one, a half one if there is one."""
    found = {p.name: p.read_bytes() for p in folder.iterdir() if not is_scratch(p.name)}
    if new := [text for name, text in found.items() if name.startswith("new")]:
        return {"new.txt": min(new, key=lambda text: text[:-1] == _WHOLE.encode())}
    return found


class Trap:
    """Counts the calls of a process that touch a folder; at one of them it kills it, or tells who shall do so."""

    def __init__(self, folder: Path, left: int = -1, pipe: int | None = None) -> None:
        self.folder, self.left, self.pipe = str(folder), left, pipe
        self.seen = 0
        sys.addaudithook(self.listen)
        flush = os.fsync

        def watched(fd: Any) -> None:
            self.count()
            flush(fd)

        os.fsync = watched

    def count(self) -> None:
        self.seen += 1
        if self.left == 0 and self.pipe is None:
            os.kill(os.getpid(), signal.SIGKILL)
        elif self.left == 0:
            os.write(self.pipe or 0, b"now")
        self.left -= 1

    def listen(self, event: str, arguments: tuple[Any, ...]) -> None:
        if (event == "open" or event.startswith(("os.", "shutil."))) and any(
            isinstance(a, str | Path) and str(a).startswith(self.folder) for a in arguments
        ):
            self.count()


def forked(work: Callable[[], None]) -> int:
    """Start a process that does some work."""
    if pid := os.fork():
        return pid
    code = 1
    try:
        work()
        code = 0
    except Exception:
        traceback.print_exc()
        raise
    finally:
        os._exit(code)


def measured(writer: Writer, folder: Path, facts: Path) -> dict[str, Any]:
    """What a kind writes in both versions, how long it takes and how many calls it makes: told by a child."""

    def work() -> None:
        writer.write(folder, 0)
        found = [contents(folder)]
        trap, begin = Trap(folder), time.perf_counter()
        writer.write(folder, 1)
        found.append(contents(folder))
        versions = {name: [v[name].hex() for v in found] for name in writer.names}
        facts.write_text(json.dumps([time.perf_counter() - begin, trap.seen, versions]), encoding="utf-8")

    assert os.waitstatus_to_exitcode(os.waitpid(forked(work), 0)[1]) == 0
    seconds, calls, versions = json.loads(facts.read_text(encoding="utf-8"))
    texts = {name: {bytes.fromhex(v) for v in both} for name, both in versions.items()}
    return {"seconds": seconds, "calls": calls, "versions": texts}


def killed(writer: Writer, folder: Path, known: dict[str, Any], lot: random.Random, how: str) -> bool:
    """Run a kind, over and over, until it is killed; return whether that was by us."""
    left, (told, tell) = lot.randrange(2 * known["calls"]), os.pipe()

    def work() -> None:
        if how != "clock":
            Trap(folder, left, tell if how == "soon after a call" else None)
        for k in range(_ENOUGH):
            writer.write(folder, k % 2)

    pid = forked(work)
    os.close(tell)
    if how == "clock":
        time.sleep(lot.uniform(0.0, 2.0 * known["seconds"]) + 0.002)
    elif how == "soon after a call":
        os.read(told, 1)
        until = time.perf_counter() + lot.uniform(0.0, 0.0005)
        while time.perf_counter() < until:
            pass
    os.close(told)
    if how != "at a call":
        os.kill(pid, signal.SIGKILL)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == -signal.SIGKILL


def main(home: Path, kills: int, seed: int) -> dict[str, Any]:
    """Kill so many runs, and look after each."""
    lot = random.Random(seed)
    found: Counter[str] = Counter()
    wrong: list[str] = []
    folders, facts = {}, {}
    for kind, writer in KINDS.items():
        aside = home / f"aside {kind}"
        aside.mkdir()
        facts[kind] = measured(writer, aside, home / "facts.json")
        folders[kind] = home / kind
        folders[kind].mkdir()
    there: dict[str, set[str]] = {kind: set() for kind in KINDS}
    for k in range(kills):
        kind = list(KINDS)[k % len(KINDS)]
        folder = folders[kind]
        if not killed(KINDS[kind], folder, facts[kind], lot, HOW[k // len(KINDS) % len(HOW)]):
            wrong.append(f"{kind}: ended by itself")
            continue
        found[f"kills of {kind}"] += 1
        found["kills"] += 1
        now = contents(folder)
        for name, text in now.items():
            if text not in facts[kind]["versions"].get(name, ()):
                found["half files"] += 1
                wrong.append(f"{kind}: {name} has {len(text)} bytes")
        found["files lost"] += len(there[kind] - set(now))
        there[kind] = set(now)
        found["killed with leftovers"] += any(is_scratch(p.name) for p in folder.iterdir())
    for kind, folder in folders.items():
        found["leftovers before the next run"] += sum(is_scratch(p.name) for p in folder.iterdir())
        write_text("something else", folder / "other.txt", overwrite=False)
        found["leftovers"] += sum(is_scratch(p.name) for p in folder.iterdir())
        found["kinds with all files"] += there[kind] == set(KINDS[kind].names)
    return {**found, "half files": found["half files"], "leftovers": found["leftovers"], "wrong": wrong}


if __name__ == "__main__":
    print(json.dumps(main(Path(sys.argv[1]).resolve(), int(sys.argv[2]), int(sys.argv[3]))))

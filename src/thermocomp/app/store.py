"""Files of a project as its page changes them: each version that is replaced is kept; loads no training code."""

import asyncio
import os
import re
import subprocess
import sys
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import suppress
from hashlib import sha256
from pathlib import Path, PureWindowsPath
from typing import Any

import tomlkit

from thermocomp.app.runfolder import runs_of
from thermocomp.app.workers import Workers
from thermocomp.core.exceptions import InputError
from thermocomp.files.draft import draft, write_text
from thermocomp.files.plaintext import read_text
from thermocomp.files.tomlfile import MOST
from thermocomp.report.language import LANGUAGES

NAME = "project.toml"
#: largest file that can be dropped on the page [bytes]
LARGEST = 1_000_000_000
#: maximum time that the process of a run takes to end after its result is written [s]
ENDING = 30.0
#: names of files that every system accepts
_PLAIN = re.compile(r"[^\w .()+-]")
_NEW = 'name = ""\n'
#: CREATE_NEW_PROCESS_GROUP, CREATE_NO_WINDOW: Ctrl-C and the closed window of the page do not end a run on Windows
_OWN_CONSOLE = 0x0000_0200 | 0x0800_0000


class Store:
    """Folder of a project.

    Parameters
    ----------
    folder : Path
        Created with an empty ``project.toml`` if missing.

    Raises
    ------
    InputError
        The folder cannot be written, or its ``project.toml`` is not TOML.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        try:
            (folder / "files").mkdir(parents=True, exist_ok=True)
        except OSError as e:
            raise InputError(f"{folder}: the project's folder cannot be written: {e.strerror}") from e
        if not (folder / NAME).exists():
            write_text(_NEW, folder / NAME, overwrite=False)
        self.editing, self.workers = asyncio.Lock(), Workers()
        self.preferred = ""
        self._run: subprocess.Popen[bytes] | None = None
        self._said, self._before = 0, ("", 0)
        self._read: dict[str, tuple[tuple[Any, ...], dict[str, Any]]] = {}
        self.document()

    def document(self) -> tomlkit.TOMLDocument:
        """Return the settings, with their comments.

        Raises
        ------
        InputError
            The file is not TOML.
        """
        path = self.folder / NAME
        try:
            return tomlkit.parse(read_text(path, "project file", MOST))
        except tomlkit.exceptions.TOMLKitError as e:
            raise InputError(f"{path}: not valid TOML: {e}") from e

    def content(self) -> dict[str, Any]:
        """Return the settings."""
        return self.document().unwrap()

    def language(self) -> str:
        """Return the language that was chosen, else that of the browser which opened the page."""
        chosen = str(self.content().get("language", ""))
        return chosen if chosen in LANGUAGES else self.preferred  # a file edited by hand may name any

    async def save(self, document: tomlkit.TOMLDocument) -> None:
        """Write settings after they have been validated.

        Raises
        ------
        InputError
            They are not valid.
        """
        await self.workers.ask({"task": "settings", "content": document.unwrap()})
        self.replace(NAME, tomlkit.dumps(document))

    def replace(self, name: str, text: str) -> None:
        """Write a text file; the version that it replaces is kept in ``history``."""
        path = self.folder / name
        if path.exists():
            (self.folder / "history").mkdir(exist_ok=True)
            kept = self._versions(name)
            number = int(kept[-1].suffix[1:]) + 1 if kept else 1
            write_text(path.read_text(encoding="utf-8"), self._version(name, number), overwrite=False)
        write_text(text, path, overwrite=True)

    def undo(self, name: str) -> None:
        """Put the last replaced version of a file in its place.

        Raises
        ------
        InputError
            There is none.
        """
        if not (kept := self._versions(name)):
            raise InputError(f"{name}: there is no earlier version")
        write_text(kept[-1].read_text(encoding="utf-8"), self.folder / name, overwrite=True)
        kept[-1].unlink()

    def _version(self, name: str, number: int) -> Path:
        return self.folder / "history" / f"{Path(name).name}.{number}"

    def _versions(self, name: str) -> list[Path]:
        found = (self.folder / "history").glob(f"{Path(name).name.replace('[', '[[]')}.*")
        return sorted((p for p in found if p.suffix[1:].isdigit()), key=lambda p: int(p.suffix[1:]))

    # -- recordings ----------------------------------------------------------------------------------------------------

    async def receive(self, name: str, parts: AsyncIterator[bytes]) -> str:
        """Write a dropped file under a free name, and return its name in the project."""
        path, size, whole = self._free(name), 0, sha256()
        with draft(path, overwrite=False) as target:
            with target.open("wb") as file:
                async for part in parts:
                    size += len(part)
                    whole.update(part)
                    if size > LARGEST:
                        raise InputError(f"{name}: the file has more than {LARGEST:,} bytes")
                    file.write(part)
            if same := self._same(size, whole.digest()):
                raise InputError(f"{name}: the project has this file already, as {same}")
        return f"files/{path.name}"

    async def adopt(self, name: str) -> dict[str, Any]:
        """Add a received file to the recordings, with a mapping that takes the best guesses, and return its preview."""
        path = find_inside(self.folder, name)
        found = await self._ask(path, "", guess=True)
        async with self.editing:
            document, table = self.document(), tomlkit.table()
            table["file"] = name
            if found["mapping"]:
                self.replace(f"{name}.toml", found["mapping"])
                table["mapping"] = f"{name}.toml"
            document.setdefault("recordings", tomlkit.aot()).append(table)
            self.replace(NAME, tomlkit.dumps(document))
        self._read[name] = (self._known(path, found["mapping"]), found)
        return found

    async def move(self, name: str, to: str = "") -> None:
        """Move a recording to a list of the settings; to none: its file stays in the folder."""
        async with self.editing:
            document = self.document()
            table = self.entry(document, name).unwrap()
            for key in ("recordings", "assess"):
                kept = [t.unwrap() for t in document.get(key, ()) if t.get("file") != name]
                document.pop(key, None)
                if kept := [*kept, *([table] if key == to else [])]:
                    document[key] = kept
            self.replace(NAME, tomlkit.dumps(document))

    def _same(self, size: int, digest: bytes) -> str:
        """Return the name of a recording of the project with the same content; empty if there is none."""
        for table in self.document().get("recordings", ()):
            path = self.folder / str(table.get("file", ""))
            with suppress(OSError):
                if path.stat().st_size == size and sha256(path.read_bytes()).digest() == digest:
                    return path.name
        return ""

    def _free(self, name: str) -> Path:
        """Return a path for a file: its name without signs that a system rejects, with a number if it exists."""
        stem, suffix = Path(name.replace("\\", "/")).stem, Path(name).suffix
        plain = _PLAIN.sub("_", stem).strip(" .")[:80] or "recording"
        if PureWindowsPath(plain).is_reserved():
            plain = f"_{plain}"
        end, number = _PLAIN.sub("", suffix)[:12].lower(), 1
        path = self.folder / "files" / f"{plain}{end}"
        while path.exists():
            number += 1
            path = path.with_name(f"{plain}-{number}{end}")
        return path

    def entry(self, document: tomlkit.TOMLDocument, name: str) -> Any:
        """Return the table of a recording in the settings.

        Raises
        ------
        InputError
            There is none.
        """
        for list_of in ("recordings", "assess"):
            for table in document.get(list_of, ()):
                if table.get("file") == name:
                    return table
        raise InputError(f"{name}: the project has no such recording")

    async def preview(self, name: str) -> dict[str, Any]:
        """Return what a recording contains, see `thermocomp.app.worker.preview`; read again only if it has changed."""
        table = self.entry(self.document(), name)
        path, mapping = find_inside(self.folder, name), str(table.get("mapping", ""))
        text = self._text(mapping)
        with suppress(OSError):
            known = self._known(path, text)
            if (found := self._read.get(name)) is None or found[0] != known:
                self._read[name] = found = (known, await self._ask(path, text))
            return found[1]
        raise InputError(f"{name}: the file cannot be read")

    async def answer(self, name: str, answers: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
        """Add entries to the mapping of a recording, and return its preview."""
        async with self.editing:
            table = self.entry(document := self.document(), name)
            mapping = str(table.get("mapping", ""))
            path, text = find_inside(self.folder, name), self._text(mapping)
            found = await self._ask(path, text, answers)
            if found["mapping"] != text:
                self.replace(wanted := mapping or f"{name}.toml", found["mapping"])
                if not mapping:
                    table["mapping"] = wanted
                    self.replace(NAME, tomlkit.dumps(document))
            self._read[name] = (self._known(path, found["mapping"]), found)
            return found

    async def _ask(
        self, path: Path, mapping: str, answers: Sequence[Mapping[str, Any]] = (), *, guess: bool = False
    ) -> dict[str, Any]:
        task = {"task": "preview", "file": str(path), "mapping": mapping, "guess": guess, "answers": [*answers]}
        return await self.workers.ask({**task, "language": self.language()})

    def _known(self, path: Path, mapping: str) -> tuple[Any, ...]:
        """Return what a preview depends on."""
        return path.stat().st_mtime_ns, path.stat().st_size, mapping, self.language()

    # -- runs ----------------------------------------------------------------------------------------------------------

    async def start_run(self, *, again: bool, number: int = 0) -> None:
        """Start a run of the project as a process that does not end with this one.

        Parameters
        ----------
        again, number
            See `thermocomp.app.running.run_project`.

        Raises
        ------
        InputError
            The last one that was started here has not ended.
        """
        ended = self._last_end()
        if self._run is not None and ended[0] and ended != self._before:  # its result is there: it is about to end
            with suppress(subprocess.TimeoutExpired):
                await asyncio.to_thread(self._run.wait, ENDING)
        if self._run is not None and self._run.poll() is None:
            raise InputError("a run is going on: stop it first, or wait for its end")
        self._before = ended
        words = [sys.executable, "-X", "utf8", "-m", "thermocomp", "run", "."]
        words += [*(["--again"] if again else []), *(["--number", str(number)] if number else [])]
        more: dict[str, Any] = {"start_new_session": True} if os.name == "posix" else {"creationflags": _OWN_CONSOLE}
        nothing = subprocess.DEVNULL
        with (self.folder / "run.log").open("ab") as log:
            self._said = log.tell()
            self._run = subprocess.Popen(words, stdin=nothing, stdout=log, stderr=log, cwd=self.folder, **more)

    def _last_end(self) -> tuple[str, int]:
        """Return time and number of the run that ended last; of none while one goes on."""
        found = [run.read() for run in runs_of(self.folder)]
        if any(run["state"] == "running" for run in found):
            return "", 0
        return max(((run["ended"], run["number"]) for run in found), default=("", 0))

    def trouble(self) -> str:
        """Return what the last run that was started here said if it refused its input, maybe before it had a folder."""
        if self._run is None or self._run.poll() != 2 or self._last_end() != self._before:
            return ""  # what a run has said is in its folder
        with suppress(OSError), (self.folder / "run.log").open("rb") as log:
            log.seek(self._said)
            return " ".join(log.read(10_000).decode(errors="replace").split())
        return ""

    def _text(self, mapping: str) -> str:
        return read_text(find_inside(self.folder, mapping), "mapping file", MOST) if mapping else ""


def find_inside(folder: Path, name: str) -> Path:
    """Return the path of a file in a folder.

    Raises
    ------
    InputError
        The name, or a link, leads elsewhere.
    """
    try:
        path = folder / name
        if path.resolve().is_relative_to(folder.resolve()):
            path.exists()  # fails for a name that is too long
            return path
    except (OSError, ValueError):  # a null character, half a character
        pass
    raise InputError(f"{name!r}: the file is not in the project's folder; copy it there")

"""What a project needs of the system exists on Windows too: the parts that only POSIX has are taken away."""

import asyncio
import mimetypes
import shlex
import subprocess
import sys
from pathlib import Path

import httpx
import pytest
from projects import small_project

from thermocomp.app.store import Store
from thermocomp.app.web import make_app
from thermocomp.core.exceptions import InputError
from thermocomp.files import draft

#: what Windows lacks, as far as Python itself works here without it
SCRIPT = """
import os, signal, sys, time, warnings
from importlib import import_module

import asyncio, joblib, multiprocessing.util, pandas, sklearn, uvicorn  # others' own ways on this system

for name in ("fcntl", "resource", "pwd", "grp", "termios", "posix_ipc", "syslog"):
    sys.modules[name] = None
for name in ("fork", "getuid", "geteuid", "mkfifo", "killpg", "uname", "nice", "O_DIRECTORY", "O_NOFOLLOW"):
    delattr(os, name)
for name in ("SIGKILL", "SIGHUP", "SIGALRM", "pthread_sigmask", "SIGUSR1", "SIGUSR2", "SIGQUIT"):
    delattr(signal, name)
for name in ("clock_gettime", "tzset"):
    delattr(time, name)

warnings.filterwarnings("error", category=EncodingWarning, module="thermocomp")  # as the country has it, there

for name in ("project", "runfolder", "running", "store", "web", "worker", "workers", "commands.app", "commands.run"):
    import_module(f"thermocomp.app.{name}")
from thermocomp.api.keywords import silent
from thermocomp.app.project import Project
from thermocomp.app.running import run_project
from thermocomp.app.store import Store
from thermocomp.app.web import make_app
from thermocomp.app.worker import preview
from pathlib import Path

folder = Path(sys.argv[1])
make_app(Store(folder))
assert preview(str(folder / "files" / "drift.csv"), "", True, [])["targets"]
store = Store(folder)
store.replace("project.toml", (folder / "project.toml").read_text(encoding="utf-8") + "\\n# once more\\n")
store.undo("project.toml")
assert run_project(Project(folder), silent).folder.read()["state"] == "done"
"""


def test_a_project_runs_without_what_windows_lacks(tmp_path: Path) -> None:
    folder = small_project(tmp_path / "Über uns" / "project (1)")
    words = [sys.executable, "-X", "warn_default_encoding", "-c", SCRIPT]
    ended = subprocess.run([*words, str(folder)], capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr[-3000:]


def test_scripts_are_scripts_whatever_the_system_calls_them(tmp_path: Path) -> None:
    mimetypes.add_type("text/plain", ".js")  # as the registry of Windows may have it
    transport = httpx.ASGITransport(app=make_app(Store(tmp_path), "token"))

    async def work() -> None:
        async with httpx.AsyncClient(transport=transport, base_url="http://127.0.0.1/token/static/") as client:
            for path, kind in (("app.js", "javascript"), ("uplot.min.js", "javascript"), ("app.css", "css")):
                assert (await client.get(path)).headers["content-type"].startswith(f"text/{kind}")

    asyncio.run(work())


def test_the_command_of_a_folder_with_blanks_can_be_copied(tmp_path: Path) -> None:
    folder = tmp_path / "my project"
    transport = httpx.ASGITransport(app=make_app(Store(folder), "token"))

    async def work() -> None:
        async with httpx.AsyncClient(transport=transport, base_url="http://127.0.0.1/token/") as client:
            command = (await client.get("api/project")).json()["command"]
        assert shlex.split(command) == ["thermocomp", "run", str(folder)]

    asyncio.run(work())


def test_a_file_that_is_being_read_is_replaced_a_moment_later(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The state of a run is read by the page twice a second, and Windows does not replace a file that is open."""
    file, left, replace = tmp_path / "run.json", [2], Path.replace
    draft.write_text("old", file, overwrite=True)

    def held(self: Path, target: Path) -> Path:
        if left[0]:
            left[0] -= 1
            raise PermissionError(13, "used by another process")
        return replace(self, target)

    monkeypatch.setattr(Path, "replace", held)
    with pytest.raises(InputError):
        draft.write_text("new", file, overwrite=True)
    assert file.read_text(encoding="utf-8") == "old"
    monkeypatch.setattr(draft, "HELD", (0.0, 0.0))
    left[0] = 2
    draft.write_text("new", file, overwrite=True)
    assert file.read_text(encoding="utf-8") == "new"

"""Run tests on a copy of the project into which a change was made."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

TOOLS = Path(__file__).resolve().parents[1]
COPIED = ("src", "tests", "pyproject.toml")
#: a change may make a loop endless [s]
PATIENCE = 300
#: a change that makes no assertion fail, but raises something else or runs for too long, proves nothing
KILLED, SURVIVED, RAISED = "killed", "survived", "raised"


class Copy:
    """A copy of the project; its tests run in a process of their own.

    Parameters
    ----------
    root : Path
        The project.
    folder : Path
        Where to copy it; must not exist.
    """

    def __init__(self, root: Path, folder: Path) -> None:
        self.folder, self.package = folder, folder / "src" / "thermocomp"
        folder.mkdir()
        for part in filter(Path.exists, map(root.joinpath, COPIED)):
            if part.is_dir():
                shutil.copytree(part, folder / part.name, ignore=shutil.ignore_patterns("__pycache__"))
            else:
                shutil.copy(part, folder)
        self._noted = folder / "verdict.txt"
        environment = {
            "THERMOCOMP_DATA": str(root.parent / "shared" / "data"),
            **os.environ,
            "PYTHONPATH": os.pathsep.join(map(str, (folder / "src", TOOLS))),
            "HYPOTHESIS_PROFILE": "mutants",
            "MUTANT_VERDICT": str(self._noted),
            "OMP_NUM_THREADS": "1",
            "OPENBLAS_NUM_THREADS": "1",
        }
        self._forks = subprocess.Popen(
            [sys.executable, "-m", "mutants.forks"],
            cwd=folder,
            env=environment,
            text=True,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )

    def close(self) -> None:
        """End the process that runs the tests."""
        self._forks.communicate()

    def run(self, tests: Sequence[str], patience: int = 0, compiled: str = "kernels") -> list[list[str]]:
        """Run tests; return the outcome and the name of each, and ``raised pytest`` if they could not be run.

        Parameters
        ----------
        patience : int
            Time limit [s]; 0: none.
        compiled : str
            Folder of compiled kernels.
        """
        self._noted.unlink(missing_ok=True)
        assert self._forks.stdin and self._forks.stdout  # noqa: PT018
        print(
            json.dumps([[f"tests/{t}" for t in tests], patience, str(self.folder / compiled)]),
            file=self._forks.stdin,
            flush=True,
        )
        failed = int(self._forks.stdout.readline()) not in (0, 1, 2)
        lines = self._noted.read_text(encoding="utf-8").splitlines() if self._noted.exists() else []
        outcomes = [line.replace(" tests/", " ", 1).split(" ", 1) for line in lines]
        return outcomes + ([[RAISED, "pytest"]] if failed or not lines else [])

    def judge(self, file: str, text: str, tests: Sequence[str]) -> tuple[str, str]:
        """Run tests with another text of a source file; return the verdict, and the test that killed or raised."""
        path = self.package / file
        before, stamp = path.read_bytes(), path.stat()
        path.write_bytes(text.encode())
        # numba looks at the file of a kernel only, not at those that it calls
        compiled = "changed" if "kernels/" in file else "kernels"
        try:
            outcomes = self.run(tests, PATIENCE, compiled)
        finally:
            path.write_bytes(before)
            os.utime(path, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))
            shutil.rmtree(self.folder / "changed", ignore_errors=True)
        found = dict(reversed(outcomes))
        return next(((v, found[v]) for v in (KILLED, RAISED) if v in found), (SURVIVED, ""))

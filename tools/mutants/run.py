"""Run the tests of a requirement on a copy of the project into which a change was made."""

import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

TOOLS = Path(__file__).resolve().parents[1]
COPIED = ("src", "tests", "pyproject.toml")
#: a change may make a loop endless [s]
PATIENCE = 120.0
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
        self.folder = folder
        self.package = folder / "src" / "thermocomp"
        folder.mkdir()
        for part in COPIED:
            if (root / part).is_dir():
                shutil.copytree(root / part, folder / part, ignore=shutil.ignore_patterns("__pycache__"))
            elif (root / part).exists():
                shutil.copy(root / part, folder / part)
        data = os.environ.get("THERMOCOMP_DATA", str(root.parent / "shared" / "data"))
        self._environment = {
            **os.environ,
            "PYTHONPATH": os.pathsep.join(map(str, (folder / "src", TOOLS))),
            "THERMOCOMP_DATA": data,
            "HYPOTHESIS_PROFILE": "ci",
            "MUTANT_VERDICT": str(folder / "verdict.txt"),
            "OMP_NUM_THREADS": "1",
            "OPENBLAS_NUM_THREADS": "1",
        }

    def run(self, tests: Sequence[str], patience: float | None = None, *, compiled: str = "kernels") -> list[list[str]]:
        """Run tests; return the outcome and the name of each, and ``raised`` at the end if pytest itself failed."""
        noted = self.folder / "verdict.txt"
        noted.unlink(missing_ok=True)
        command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "mutants.verdict", "--tb=no"]
        environment = self._environment | {"NUMBA_CACHE_DIR": str(self.folder / compiled)}
        try:
            done = subprocess.run(
                [*command, *(f"tests/{t}" for t in tests)],
                cwd=self.folder,
                env=environment,
                capture_output=True,
                timeout=patience,
                check=False,
            )
            code = done.returncode
        except subprocess.TimeoutExpired:
            code = -1
        lines = noted.read_text(encoding="utf-8").splitlines() if noted.exists() else []
        return [line.split(" ", 1) for line in lines] + ([] if code in (0, 1, 2) and lines else [[RAISED, "pytest"]])

    def judge(self, file: str, text: str, tests: Sequence[str]) -> tuple[str, str]:
        """Run tests with another text of a source file; return the verdict, and the test that killed or raised."""
        path = self.package / file
        before, stamp = path.read_bytes(), path.stat()
        path.write_bytes(text.encode())
        # numba looks at the file of a kernel only, not at those that it calls
        compiled = "changed" if "kernels/" in file else "kernels"
        try:
            outcomes = self.run(tests, PATIENCE, compiled=compiled)
        finally:
            path.write_bytes(before)
            os.utime(path, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))
            shutil.rmtree(self.folder / "changed", ignore_errors=True)
        for verdict in (KILLED, RAISED):
            for outcome, test in outcomes:
                if outcome == verdict:
                    return verdict, test.removeprefix("tests/")
        return SURVIVED, ""

"""Run pytest repeatedly, each time in a fork of this process, which has imported the libraries but not the package."""

import importlib
import json
import os
import signal
import sys

import pytest

LIBRARIES = (
    "cyclopts hypothesis jinja2 joblib matplotlib.pyplot numba numpy pandas pyarrow pydantic rich scipy.linalg "
    "scipy.optimize scipy.stats sklearn.pipeline sklearn.utils.estimator_checks"
)
#: pytest's options: the libraries are there already, and their assertions need no rewriting
OPTIONS = [
    "-q",
    "--tb=no",
    "-p",
    "no:cacheprovider",
    "-p",
    "mutants.verdict",
    "-W",
    "ignore::pytest.PytestAssertRewriteWarning",
]


def run(tests: list[str], patience: int, compiled: str) -> int:
    """Run tests in a fork; return its exit code, negative if it took longer than `patience` (if not 0) [s]."""
    if (child := os.fork()) == 0:
        sys.modules["numba.core.config"].__dict__["CACHE_DIR"] = compiled
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        signal.alarm(patience)
        os._exit(pytest.main([*OPTIONS, *tests]))
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


if __name__ == "__main__":
    for name in LIBRARIES.split():
        importlib.import_module(name)
    for line in sys.stdin:
        print(run(*json.loads(line)), flush=True)

"""Mutation test: reintroduce faults that caused wrong moves of NC programs, one at a time; a test must fail each time.

Run with ``python benchmarks/nc_mutants.py [N1 proof ...]``: names of mutants, or their beginnings; all if none is
given. Source and tests are copied to a temporary folder. There the tests of all mutants must pass; then each mutant of
`nc_mutants.toml` is inserted into the source, and one of its tests must fail. Exit code 1 if a mutant is not detected.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
COPIED = ("src", "tests", "pyproject.toml")
#: pytest's codes, and that of a run that does not end
PASSED, FAILED, HANGS = 0, 1, -1
#: a mutant may make a loop endless [s]
PATIENCE = 300


class Mutant(NamedTuple):
    """A fault to be reintroduced."""

    name: str
    what: str
    file: str  #: of the package
    old: str  #: occurs once in the file
    new: str
    tests: list[str]  #: of which one has to fail
    also: Sequence[dict[str, str]] = ()  #: more to replace at once: file, old, new


class StrayError(Exception):
    """The text that a mutant replaces is missing, or occurs more than once."""


def run(folder: Path, tests: Sequence[str], patience: float | None = None) -> tuple[int, str]:
    """Run tests on the copy; return pytest's exit code and output."""
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-x",
        "-q",
        "-p",
        "no:cacheprovider",
        "--tb=line",
        "-m",
        "",  # those that take long, too
        *(f"tests/{test}" for test in tests),
    ]
    environment = {**os.environ, "PYTHONPATH": str(folder / "src")}
    try:
        done = subprocess.run(
            command, cwd=folder, env=environment, capture_output=True, text=True, timeout=patience, check=False
        )
    except subprocess.TimeoutExpired:
        return HANGS, ""
    return done.returncode, done.stdout + done.stderr


def apply(mutant: Mutant, source: Path) -> dict[Path, str]:
    """Insert a mutant into the source; return the original files."""
    before: dict[Path, str] = {}
    for file, old, new in (mutant[2:5], *((more["file"], more["old"], more["new"]) for more in mutant.also)):
        path = source / file
        text = path.read_text(encoding="utf-8")
        if text.count(old) != 1:
            raise StrayError(f"{mutant.name}: {text.count(old)} times in {file}: {old!r}")
        before.setdefault(path, text)
        write(path, text.replace(old, new))
    return before


def take_back(before: dict[Path, str]) -> None:
    """Restore the original files."""
    for path, text in before.items():
        write(path, text)


def write(path: Path, text: str) -> None:
    """Write a source file; its compiled form is not given from one of the same second and size."""
    path.write_text(text, encoding="utf-8")
    for compiled in (path.parent / "__pycache__").glob(f"{path.stem}.*.pyc"):
        compiled.unlink()


def judge(mutant: Mutant, folder: Path) -> bool:
    """Return whether a test detects a mutant; print a line."""
    begin = time.perf_counter()
    before = apply(mutant, folder / "src" / "thermocomp")
    code, said = run(folder, mutant.tests, PATIENCE)
    take_back(before)
    verdict = {FAILED: "killed", PASSED: "SURVIVED", HANGS: "HANGS"}.get(code, f"BROKEN (pytest {code})")
    print(f"{mutant.name:22} {mutant.what:88} {verdict} {time.perf_counter() - begin:6.1f} s", flush=True)
    if verdict.startswith("BROKEN"):
        print(said[-2000:])
    return code == FAILED


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("names", nargs="*", help="of mutants, or how they begin")
    names = parser.parse_args().names
    with Path(__file__).with_suffix(".toml").open("rb") as file:
        mutants = [Mutant(**told) for told in tomllib.load(file)["mutant"]]
    chosen = [m for m in mutants if not names or any(m.name == n or m.name.startswith(f"{n}-") for n in names)]
    if not chosen:
        parser.error(f"there is none of these: {', '.join(m.name for m in mutants)}")
    with tempfile.TemporaryDirectory(prefix="nc-mutants-") as name:
        folder = Path(name)
        for part in COPIED:
            if (ROOT / part).is_dir():
                shutil.copytree(
                    ROOT / part, folder / part, ignore=shutil.ignore_patterns("__pycache__", "kernels/*.nb*")
                )
            else:
                shutil.copy(ROOT / part, folder / part)
        try:
            for mutant in chosen:  # all of them are there, before any test is run
                take_back(apply(mutant, folder / "src" / "thermocomp"))
        except StrayError as error:
            print(error, file=sys.stderr)
            return 2
        begin = time.perf_counter()
        code, said = run(folder, sorted({test for mutant in chosen for test in mutant.tests}))
        if code != PASSED:
            print(said[-4000:], "\nthe tests do not pass without a mutant", file=sys.stderr, sep="")
            return 2
        print(f"without a mutant all tests pass: {time.perf_counter() - begin:.1f} s", flush=True)
        killed = sum(judge(mutant, folder) for mutant in chosen)
    print(f"{killed} of {len(chosen)} mutants killed")
    return int(killed < len(chosen))


if __name__ == "__main__":
    sys.exit(main())

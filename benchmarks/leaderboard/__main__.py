"""Leaderboard: every model on every test, as one table. See README.md in this folder."""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
import platform
import re
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from board import add, models, rank, run, score, table
from cases import CASES
from published import evaluate, read_log

from thermocomp import __version__
from thermocomp.core.exceptions import InputError, ThermocompError, explain_unknown
from thermocomp.files.draft import write_text

HERE = Path(__file__).resolve().parent
LOG = HERE / "published_block.md"


def main() -> int:
    parser = argparse.ArgumentParser(prog="leaderboard", description=__doc__)
    parser.add_argument("--models", help="names of models, separated by commas (default: all)")
    parser.add_argument("--tests", help=f"names of tests (default: all): {', '.join(CASES)}")
    parser.add_argument(
        "--seconds", type=float, default=40.0, help="limit of the processor time per model and test [s] (default 40)"
    )
    parser.add_argument(
        "-o", "--output", type=Path, help="folder for board.json and board.md (default: that of this script)"
    )
    parser.add_argument("--add", action="store_true", help="add the models to the board, and keep its other rows")
    parser.add_argument("--published", metavar="MODEL", help="evaluate MODEL on the published block, append to log")
    args = parser.parse_args()
    if not args.seconds > 0:
        parser.error(f"--seconds {args.seconds:g}: expected more than 0")
    try:
        entries = models(HERE / "models")
        if args.published:
            (name,) = chosen(args.published, entries, "model")
            print(" | ".join(evaluate(name, entries[name], LOG, commit())))
            return 0
        names, tests = chosen(args.models, entries, "model"), chosen(args.tests, CASES, "test")
        log = read_log(LOG)
        found = make({name: entries[name] for name in names}, tests, args.seconds)
        if args.add:
            found = add(json.loads((HERE / "board.json").read_text(encoding="utf-8")), found)
        page = table(found, log)
        print(page)
        # a part of the board does not replace the whole one, unless a folder is named
        folder = args.output or (HERE if args.add or args.models is args.tests is None else None)
        if folder:
            folder.mkdir(parents=True, exist_ok=True)
            write_text(json.dumps(found, indent=1) + "\n", folder / "board.json", overwrite=True)
            write_text(page, folder / "board.md", overwrite=True)
    except ThermocompError as e:
        print(f"leaderboard: {e}", file=sys.stderr)
        return 2
    return 0 if all(m["score"] is not None for m in found["models"].values()) else 1


def chosen(text: str | None, known: Any, what: str) -> list[str]:
    names = list(known) if text is None else [n.strip() for n in text.split(",") if n.strip()]
    for name in names or [""]:
        if name not in known:
            raise explain_unknown(what, name, known)
    return names


def make(entries: dict[str, Path | None], tests: list[str], seconds: float) -> dict[str, Any]:
    absent = {c: reason for c in tests if (reason := CASES[c].absent)}
    if len(absent) == len(tests):
        raise InputError(f"no test can be run: {'; '.join(absent.values())}")
    begun, code = datetime.now(UTC), commit()
    results: dict[str, dict[str, Any]] = {name: {} for name in entries}
    for name, case, result in run(entries, [c for c in tests if c not in absent], seconds):
        results[name][case] = result
        print(
            f"{case} {name}: {result.get('error') or format(result['share_mae'], '.1%')}", file=sys.stderr, flush=True
        )
    ranking = rank(results)
    summaries = {
        name: next((f.pop("summary") for f in of.values() if "summary" in f), "") for name, of in results.items()
    }
    return {
        "date": begun.date().isoformat(),
        "version": __version__,
        "commit": code,
        "processor": processor(),
        "limit": seconds,
        "tests": {
            c: {"learned": CASES[c].learned, "judged": CASES[c].judged}
            | ({"skipped": absent[c]} if c in absent else {})
            for c in tests
        },
        "ranking": ranking,
        "models": {
            name: {
                "summary": summaries[name],
                "score": score(of) if name in ranking else None,
                "tests": {c: {k: v for k, v in f.items() if k != "summary"} for c, f in of.items()},
            }
            for name, of in results.items()
        },
    }


def commit() -> str:
    """Return the commit of thermocomp in use, with a plus sign if its code or that of this folder was changed."""
    import thermocomp

    def git(*words: str) -> str:
        folder = Path(thermocomp.__file__).parent
        return subprocess.run(["git", *words], cwd=folder, capture_output=True, text=True, check=True).stdout.strip()

    try:
        changed = git("status", "--porcelain", "--", ":/src", ":/benchmarks/leaderboard/*.py")
        return git("rev-parse", "--short=7", "HEAD") + ("+" if changed else "")
    except (OSError, subprocess.CalledProcessError):
        return "unknown"


def processor() -> str:
    """Return the name of the processor."""
    info = Path("/proc/cpuinfo")
    named = re.search(r"^model name\s*:\s*(.+)$", info.read_text() if info.is_file() else "", re.MULTILINE)
    return named[1] if named else platform.processor() or platform.machine()


if __name__ == "__main__":
    sys.exit(main())

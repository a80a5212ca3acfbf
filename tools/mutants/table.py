"""The requirements, their code and tests, and the table of their mutants."""

import ast
import hashlib
import json
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

from mutants.draw import fingerprint

#: mutants of a requirement that a test has to kill
LEAST = 2


@cache
def functions(path: Path) -> dict[str, str]:
    """Return the source of each function of a file."""
    text = path.read_text(encoding="utf-8")
    defined = [n for n in ast.parse(text).body if isinstance(n, ast.FunctionDef)]
    lines = text.splitlines()
    return {
        n.name: "\n".join(lines[min([n.lineno, *(d.lineno for d in n.decorator_list)]) - 1 : n.end_lineno])
        for n in defined
    }


class Project:
    """The requirements of a project: tests and code of each, and what was found with mutants.

    Parameters
    ----------
    root : Path
        Its folder.
    """

    def __init__(self, root: Path) -> None:
        self.root, self.package = root, root / "src" / "thermocomp"
        docs = root / "docs"
        groups = tomllib.loads((docs / "requirements.toml").read_text(encoding="utf-8")).values()
        self.tests: dict[str, list[str]] = {
            key: entry["tests"] for group in groups for key, entry in group.items() if key != "title" and "tests" in entry
        }
        told = tomllib.loads((docs / "requirements_code.toml").read_text(encoding="utf-8"))
        self.code: dict[str, list[str]] = told["code"]
        self._equivalent: list[dict[str, str]] = told.get("equivalent", [])
        self._path = docs / "mutants.json"
        self.table: dict[str, Any] = json.loads(self._path.read_text(encoding="utf-8")) if self._path.exists() else {}

    def equivalent(self, piece: str, before: str, after: str) -> str:
        """Return the reason why a change makes no difference; empty if none was given."""
        return next((e["reason"] for e in self._equivalent if (e["piece"], e["before"], e["after"]) == (piece, before, after)), "")

    def state(self, key: str) -> dict[str, dict[str, str]]:
        """Return the hashes of the code and of the tests of a requirement."""
        tests = {}
        for test in self.tests[key]:
            file, _, name = test.partition("::")
            source = functions(self.root / "tests" / file)[name]
            tests[test] = hashlib.sha256(source.encode()).hexdigest()[:12]
        return {"code": {p: fingerprint(self.package, p) for p in self.code[key]}, "tests": tests}

    def gaps(self, key: str) -> list[str]:
        """Return what is wrong with a requirement's entry of the table."""
        entry = self.table.get(key)
        if entry is None:
            return ["has no mutants"]
        found = [f"{what} changed" for what, now in self.state(key).items() if entry[what] != now]
        survived = [m for m in entry["mutants"] if m["verdict"] == "survived"]
        found += [f"no test kills {m['before']!r} -> {m['after']!r} in {m['piece']}" for m in survived]
        killed = sum(m["verdict"] == "killed" for m in entry["mutants"])
        return found + ([f"only {killed} mutants were killed"] if killed < LEAST else [])

    def stale(self) -> list[str]:
        """Return the requirements whose mutants have to be run."""
        return [key for key in self.tests if self.gaps(key)]

    def save(self) -> None:
        """Write the table, one line per mutant."""
        blocks = []
        for key, entry in sorted((k, e) for k, e in self.table.items() if k in self.tests):
            rest = {k: v for k, v in entry.items() if k != "mutants"}
            mutants = ",\n".join(f"   {json.dumps(m, ensure_ascii=False)}" for m in entry["mutants"])
            lines = "".join(f"  {json.dumps(k)}: {json.dumps(v)},\n" for k, v in rest.items())
            blocks.append(f' {json.dumps(key)}: {{\n{lines}  "mutants": [\n{mutants}\n  ]\n }}')
        self._path.write_text("{\n" + ",\n".join(blocks) + "\n}\n", encoding="utf-8")

"""The requirements, their code and tests, and the table of their mutants."""

import ast
import hashlib
import json
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

from mutants.draw import fingerprint

#: mutants of a requirement that have to be killed
WANTED = 2


@cache
def functions(path: Path) -> dict[str, str]:
    """Return the source of each function of a file."""
    lines = path.read_text(encoding="utf-8").splitlines()
    defined = [n for n in ast.parse("\n".join(lines)).body if isinstance(n, ast.FunctionDef)]
    first = {n.name: min([n.lineno, *(d.lineno for d in n.decorator_list)]) for n in defined}
    return {n.name: "\n".join(lines[first[n.name] - 1 : n.end_lineno]) for n in defined}


class Project:
    """The requirements of a project: tests and code of each, and what was found with mutants."""

    def __init__(self, root: Path) -> None:
        self.root, self._path = root, root / "docs" / "mutants.json"
        groups = tomllib.loads((root / "docs" / "requirements.toml").read_text(encoding="utf-8")).values()
        entries = {key: entry for group in groups for key, entry in group.items() if key != "title"}
        self.tests: dict[str, list[str]] = {key: entry["tests"] for key, entry in entries.items() if "tests" in entry}
        told = tomllib.loads((root / "docs" / "requirements_code.toml").read_text(encoding="utf-8"))
        self.code: dict[str, list[str]] = told["code"]
        self._equivalent: list[dict[str, str]] = told.get("equivalent", [])
        self.table: dict[str, Any] = json.loads(self._path.read_text(encoding="utf-8")) if self._path.exists() else {}

    def reason(self, change: dict[str, Any]) -> str:
        """Return the reason why a change makes no difference; empty if none was given."""
        return next((e["reason"] for e in self._equivalent if {**e, **change} == e), "")

    def state(self, key: str, root: Path | None = None) -> dict[str, Any]:
        """Return the hashes of the code and of the tests of a requirement, in the project or a copy of it."""
        root = root or self.root
        sources = {t: functions(root / "tests" / t.partition("::")[0])[t.partition("::")[2]] for t in self.tests[key]}
        tests = {t: hashlib.sha256(source.encode()).hexdigest()[:12] for t, source in sources.items()}
        return {"code": {p: fingerprint(root / "src" / "thermocomp", p) for p in self.code[key]}, "tests": tests}

    def gaps(self, key: str) -> list[str]:
        """Return what is wrong with a requirement's entry of the table."""
        if key not in self.table:
            return ["has no mutants"]
        entry, now = self.table[key], self.state(key)
        killers = {m["by"].partition("[")[0] for m in entry["mutants"] if m["verdict"] == "killed"}
        needed = {"code": {*now["code"]}, "tests": killers}  # a kill stands, whatever other tests are named
        found = [
            f"{what} changed: {piece}"
            for what, pieces in needed.items()
            for piece in sorted(pieces)
            if piece not in now[what] or now[what][piece] != entry[what].get(piece)
        ]
        survived = [m for m in entry["mutants"] if m["verdict"] == "survived"]
        found += [f"no test kills {m['before']!r} -> {m['after']!r} in {m['piece']}" for m in survived]
        killed = sum(m["verdict"] == "killed" for m in entry["mutants"])
        return found + ([f"{killed} mutants were killed, expected {WANTED}"] if killed < WANTED else [])

    def save(self) -> None:
        """Write the table, one line per mutant."""
        blocks = []
        for key, entry in ((k, self.table[k]) for k in self.tests if k in self.table):
            mutants = ",\n".join(f"   {json.dumps(m, ensure_ascii=False)}" for m in entry["mutants"])
            rest = "".join(f"  {json.dumps(k)}: {json.dumps(v)},\n" for k, v in entry.items() if k != "mutants")
            blocks.append(f' {json.dumps(key)}: {{\n{rest}  "mutants": [\n{mutants}\n  ]\n }}')
        self._path.write_text("{\n" + ",\n".join(blocks) + "\n}\n", encoding="utf-8")

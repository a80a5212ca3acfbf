"""Refresh `docs/verdicts.json`, the verdicts on the papers' claims that the documentation shows: `make verdicts`."""

import hashlib
import json
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
FILE = ROOT / "docs" / "verdicts.json"
PAPERS = ROOT / "src" / "thermocomp" / "papers"


def entries(study: str) -> list[dict[str, Any]]:
    """Return the entries of a study's `claims.toml`, repeated as in `each`."""
    content = tomllib.loads((PAPERS / study / "claims.toml").read_text(encoding="utf-8"))
    found = [entry for name, section in content.items() if name != "parts" for entry in section.values()]
    return [entry for entry in found for _ in entry.get("each", [None])]


def digest(study: str) -> str:
    """Return a digest of the sentences and criteria of a study's claims."""
    keys = ("text", "paper", "holds", "softer", "whole", "reading", "premise", "each")
    kept = [[entry.get(key) for key in keys] for entry in entries(study)]
    return hashlib.sha256(json.dumps(kept).encode()).hexdigest()[:16]


def main(names: list[str]) -> None:
    """Run studies of the papers and write their claims; those of other studies are kept."""
    line = [sys.executable, "-m", "thermocomp.cli.app", "papers", *names, "--jobs", "-1", "--json"]
    made = json.loads(subprocess.run(line, stdout=subprocess.PIPE, check=True).stdout)
    known = json.loads(FILE.read_text(encoding="utf-8"))["studies"] if names and FILE.exists() else {}
    for study in made.pop("studies"):
        name = study["name"]
        known[name] = {"title": study["title"], "digest": digest(name), "claims": study["claims"]}
    content = {"made by": "make verdicts", **made, "studies": known}
    FILE.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])

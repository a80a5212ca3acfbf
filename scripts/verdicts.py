"""Refresh `docs/verdicts.json`, the verdicts on the papers' claims that the documentation shows: `make verdicts`.

`make verdicts STUDIES=measured` refreshes `docs/measured.json`: linear regression and ACE on a measured machine, from
``fl_thermal/recording.csv`` in the directory ``$THERMOCOMP_DATA``.
"""

import hashlib
import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
FILE = ROOT / "docs" / "verdicts.json"
PAPERS = ROOT / "src" / "thermocomp" / "papers"
MEASURED = ROOT / "docs" / "measured.json"
#: what is compared there (W-08)
METHODS = ("ols", "ace", "ace-monotone", "averaged")


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


def printed(*arguments: str, folder: Path | None = None) -> dict[str, Any]:
    """Return what a command prints with ``--json``."""
    line = [sys.executable, "-m", "thermocomp.cli.app", *arguments, "--jobs", "-1", "--json"]
    found: dict[str, Any] = json.loads(subprocess.run(line, cwd=folder, stdout=subprocess.PIPE, check=True).stdout)
    return found


def measure(folder: Path) -> None:
    """Compare the methods on a recording, each of its thermal cycles left out in turn, and write their RMS errors."""
    made = printed("compare", "recording.csv", "--models", *METHODS, "--no-robustness", folder=folder)
    rms: dict[str, dict[str, float]] = {method: {} for method in ("none", *METHODS)}
    for result in made["results"]:
        if result["block"] == "all unseen cycles":
            rms["none"][result["target"]] = result["none_rms_um"]
            rms[result["model"]][result["target"]] = result["alone_rms_um"]
    content = {"made by": "make verdicts STUDIES=measured", "recording": folder.name, "rms_um": rms}
    content |= {key: made[key] for key in ("thermocomp", "arguments", "judging")}
    MEASURED.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def main(names: list[str]) -> None:
    """Run studies of the papers and write their claims; those of other studies are kept."""
    if names == ["measured"]:
        measure(Path(os.environ["THERMOCOMP_DATA"]) / "fl_thermal")
        return
    made = printed("papers", *names)
    known = json.loads(FILE.read_text(encoding="utf-8"))["studies"] if names and FILE.exists() else {}
    for study in made.pop("studies"):
        name = study["name"]
        known[name] = {"title": study["title"], "digest": digest(name), "claims": study["claims"]}
    content = {"made by": "make verdicts", **made, "studies": known}
    FILE.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])

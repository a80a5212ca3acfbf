"""Two runs side by side: their results, and what was chosen differently; loads no training code."""

import json
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from thermocomp.app.runfolder import LEARNED, RunFolder
from thermocomp.app.store import NAME


def compare_runs(a: RunFolder, b: RunFolder) -> dict[str, Any]:
    """Return the results of two runs by target and method, and their differences in words."""
    found = [_results(run.path) for run in (a, b)]
    keys = dict.fromkeys(key for results in found for key in results)
    rows = [
        {"target": target, "model": model, "of": [results.get((target, model)) for results in found]}
        for target, model in keys
    ]
    return {"rows": rows, "differences": list(_differences(a, b))}


def _results(folder: Path) -> dict[tuple[str, str], dict[str, Any]]:
    """Return error, worst cycle and verdict by target and method; the last entry of each is that of all cycles."""
    content = read_json(folder / "compare.json") or {}
    used = {(r["target"], r["written"]) for r in content.get("recommended", ())}
    found = {(r["target"], r["model"]): r for r in content.get("results", ())}
    return {
        key: {
            "rms_um": r["rms_um"],
            "none_rms_um": r["none_rms_um"],
            "verdict": r["verdict"],
            "worst": max(((u["rms_um"], u["name"]) for u in r["units"] if u["rms_um"] is not None), default=None),
            "written": key in used,
        }
        for key, r in found.items()
    }


def _differences(a: RunFolder, b: RunFolder) -> Iterator[str]:
    """Yield what differs in the choices of two runs, in words."""
    states, settings = [run.read() for run in (a, b)], [_flat(_settings(run.path)) for run in (a, b)]
    first, second = settings
    for key in sorted(first.keys() | second.keys()):
        if (one := first.get(key)) != (two := second.get(key)):
            yield f"{key}: {_shown(one)}; then {_shown(two)}"
    if states[0]["version"] != states[1]["version"]:
        yield f"version of thermocomp: {states[0]['version']}; then {states[1]['version']}"
    learned = [{k: v for k, v in s.items() if k.split(".")[0] in LEARNED} for s in settings]
    if learned[0] == learned[1] and states[0]["fingerprint"] != states[1]["fingerprint"]:
        yield "the content of a recording or of its mapping"


def _settings(folder: Path) -> dict[str, Any]:
    try:
        return tomllib.loads((folder / NAME).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}


def _flat(content: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    """Return nested tables as one, its keys joined by dots; of recordings their files."""
    found: dict[str, Any] = {}
    for key, value in content.items():
        if isinstance(value, Mapping):
            found |= _flat(value, f"{before}{key}.") or {f"{before}{key}": True}
        elif isinstance(value, list) and value and all(isinstance(v, Mapping) for v in value):
            found[f"{before}{key}"] = [v.get("file", v) for v in value]
        else:
            found[f"{before}{key}"] = value
    return found


def _shown(value: Any) -> str:
    if value is None:
        return "not set"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return ", ".join(map(str, value)) if isinstance(value, list) else str(value)


def read_json(path: Path) -> Any:
    """Return the content of a JSON file; None if it cannot be read."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None

"""What may happen to the state of a service while it does not run."""

import json
from collections.abc import Callable, Mapping
from datetime import datetime, timedelta
from pathlib import Path

from thermocomp.files import jsonfile
from thermocomp.live import statefile


def _cut(state: Path) -> None:
    state.write_bytes(state.read_bytes()[: state.stat().st_size // 2])


def _date_back(state: Path) -> None:
    (entry,) = json.loads(state.read_text())["models"]
    entry["written"] = (datetime.fromisoformat(entry["written"]) - timedelta(days=2)).isoformat()
    entry["boot"] = ""
    state.write_text(jsonfile.pack(statefile.KIND, [entry]))


def _of_others(state: Path) -> None:
    (entry,) = json.loads(state.read_text())["models"]
    state.write_text(jsonfile.pack(statefile.KIND, [entry | {"models": "others"}]))


SPOILED: Mapping[str, Callable[[Path], None]] = {
    "missing": lambda state: state.unlink(),
    "cut": _cut,
    "of another model": _of_others,
    "of another day": _date_back,
}

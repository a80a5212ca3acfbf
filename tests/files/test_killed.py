"""Runs that are killed while they write, of all kinds: whole files, and nothing left after the next run."""

import json
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import killing
import pytest

KILLS = 200


@pytest.mark.long
@pytest.mark.skipif(find_spec("fcntl") is None, reason="files are not locked here")
def test_killed_runs_leave_whole_files_and_the_next_run_clears_up(tmp_path: Path) -> None:
    command = [sys.executable, killing.__file__, str(tmp_path), str(KILLS), "1"]
    found = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    print(found)
    assert found["wrong"] == []
    assert (found["kills"], found["half files"], found["files lost"], found["leftovers"]) == (KILLS, 0, 0, 0)
    # they were killed in the middle: what they were writing was there
    assert found["killed with leftovers"] > KILLS // 4
    assert found["kinds with all files"] == len(killing.KINDS)
    assert all(found[f"kills of {kind}"] >= KILLS // len(killing.KINDS) for kind in killing.KINDS)

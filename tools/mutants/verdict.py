"""A plugin of pytest: whether an assertion of a test failed, or something else was raised, into ``$MUTANT_VERDICT``."""

import os
import traceback
from pathlib import Path

import pytest
from hypothesis import Phase, settings

# as in CI, without a search for a simpler example
PHASES = (Phase.explicit, Phase.generate)
settings.register_profile(
    "mutants", max_examples=50, deadline=None, derandomize=True, phases=PHASES, report_multiple_bugs=False
)


def asserted(error: BaseException) -> bool:
    """Return whether an assertion of a test failed: an `assert` in the package is not one."""
    if not isinstance(error, AssertionError | pytest.fail.Exception):
        return False
    return "/src/thermocomp/" not in Path(traceback.extract_tb(error.__traceback__)[-1].filename).as_posix()


def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> None:
    """Note the outcome of a test; the first assertion that fails ends the run."""
    if call.excinfo is None:
        outcome = "passed" if call.when == "call" else ""
    elif isinstance(call.excinfo.value, pytest.skip.Exception):
        outcome = "skipped"
    elif call.when == "call" and asserted(call.excinfo.value):
        outcome = item.session.shouldstop = "killed"
    else:
        outcome = "raised"
    if outcome:
        with Path(os.environ["MUTANT_VERDICT"]).open("a", encoding="utf-8") as file:
            file.write(f"{outcome} {item.nodeid}\n")

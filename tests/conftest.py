"""Fixtures shared by all tests."""

import os
from pathlib import Path

import pytest

from smallmachine import small_machine
from thermocomp.recording.recording import Recording
from thermocomp.recording.samples import Samples, stack

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of the measured and reference data, which the repository does not carry."""
    folder = Path(os.environ.get("THERMOCOMP_DATA", ROOT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"the measured data are not here: looked in {folder}; set THERMOCOMP_DATA to their folder")
    return folder


@pytest.fixture(scope="session")
def recording() -> Recording:
    """A small drift test with four thermal cycles."""
    return small_machine()


@pytest.fixture(scope="session")
def samples(recording: Recording) -> Samples:
    """The same, stacked, with targets z_um and x_um."""
    return stack([recording], ["z_um", "x_um"])

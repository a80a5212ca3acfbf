"""Fixtures shared by all tests."""

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of the measured and reference data, which the repository does not carry."""
    folder = Path(os.environ.get("THERMOCOMP_DATA", ROOT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"the measured data are not here: looked in {folder}; set THERMOCOMP_DATA to their folder")
    return folder

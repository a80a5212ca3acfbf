"""Fixtures of the tests of the command line."""

from pathlib import Path

import pytest

from driftmodels import lags
from reviseruns import PLATE, judged, write_models
from thermocomp.cli import reviserun


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a program and models, where commands run; nothing is drawn and no interpreter starts."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(reviserun, "find_spec", lambda _: None)
    write_models([judged(lags("z_um"))], "model.json")
    Path("part.ngc").write_text(PLATE, encoding="ascii")
    return tmp_path

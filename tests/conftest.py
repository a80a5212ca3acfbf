"""Fixtures shared by all tests."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from broker import Mosquitto
from driftmodels import lags
from hypothesis import settings
from reviseruns import PLATE, judged, write_models
from smallmachine import small_machine

from thermocomp.nc.linuxcnc import rs274
from thermocomp.nc.revision import job as jobs
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack

ROOT = Path(__file__).resolve().parent.parent

#: of a property that does not state how many examples it wants: few at the desk, many in CI (HYPOTHESIS_PROFILE=ci)
settings.register_profile("quick", max_examples=25, deadline=None)
settings.register_profile("thorough", max_examples=200, deadline=None)
# the same examples each time: a commit passes or it does not; new ones are looked for by `make test-long`
settings.register_profile("ci", max_examples=50, deadline=None, derandomize=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "quick"))


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


@pytest.fixture(scope="session")
def interpreter() -> None:
    """LinuxCNC's interpreter is here; `make test` installs it, so on a build server it has to be."""
    if (reason := rs274.find_obstacle()) is not None:
        if os.environ.get("CI"):
            pytest.fail(reason)
        pytest.skip(reason)


@pytest.fixture
def job_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a program and a model, where commands run; nothing is drawn and no interpreter starts."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(jobs, "find_spec", lambda _: None)
    write_models([judged(lags("z_um"))], "model.json")
    Path("part.ngc").write_text(PLATE, encoding="ascii")
    return tmp_path


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[Mosquitto]:
    """Return a running mosquitto."""
    found = Mosquitto(tmp_path)
    found.start()
    yield found
    found.kill()

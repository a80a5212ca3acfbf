"""Forty recordings, all methods, two workers: the figures of this machine, within the memory that is stated."""

import os
import signal
from pathlib import Path

import pytest
from daskcluster import dask_cluster, peak_memory, wait_until
from test_cluster import assert_same

import thermocomp as tc
from thermocomp.api.results import Compared
from thermocomp.models.methods import METHODS
from thermocomp.recordings.recording import Recording

#: a worker takes no more, as docs/many_recordings.rst says; its nanny would kill it
BOUND = 1 << 30
#: of the default, each cycle left out, there are six times as many pieces
SPLIT = "0.75/0.25"

PROTOCOL = """
description = "a job of random speed and length, and the rest after it"
sampling = "10 min"
places = "usual"
probes = ["z_at_0"]
climate = "stable"
segments = [
    { duration = "10 min", speed = 0 },
    { duration = { between = ["60 min", "120 min"], step = "10 min" }, speed = { between = [500, 3300], step = 100 } },
    { duration = "60 min", speed = 0 },
]
"""


@pytest.fixture(scope="module")
def forty(tmp_path_factory: pytest.TempPathFactory) -> list[Recording]:
    path = tmp_path_factory.mktemp("forty") / "forty.toml"
    path.write_text(PROTOCOL + "".join(f'[[tests]]\nname = "{k}"\n' for k in range(40)))
    return tc.simulate(path, seed=3)


@pytest.fixture(scope="module")
def here(forty: list[Recording]) -> Compared:
    return tc.compare(forty, models="all", split=SPLIT, jobs=2)


@pytest.mark.long
@pytest.mark.parametrize("killed", [False, True])
def test_all_methods_on_forty_recordings(killed: bool, forty: list[Recording], here: Compared, tmp_path: Path) -> None:
    told: list[str] = []
    with dask_cluster(tmp_path, workers=2, memory_limit=str(BOUND)) as cluster:
        wait_until(lambda: len(cluster.workers()) == 2)
        first = cluster.workers()

        def tell(text: str) -> None:
            told.append(text)
            if killed and len(told) == 8:
                os.kill(first[0], signal.SIGKILL)

        there = tc.compare(forty, models="all", split=SPLIT, scheduler=cluster.address, progress=tell)
        wait_until(lambda: len(cluster.workers()) == 2)
        assert (cluster.workers() == first) is not killed
        peaks = [peak_memory(pid) for pid in cluster.workers()]
    assert len(there.recordings) == 40
    assert len(told) == len(METHODS)
    assert_same(there.comparison, here.comparison)
    print(f"most memory of a worker: {max(peaks) / 2**20:.0f} MiB")
    assert max(peaks) < BOUND

"""Work shared among the workers of a Dask cluster: the same figures as here, and what is said when it fails."""

import os
import signal
import socket
import sys
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from threading import Timer
from typing import Any

import numpy as np
import pytest
from daskcluster import DaskCluster, dask_cluster, lost, slow, wait_until
from distributed import Client
from smallmachine import small_machine

import thermocomp as tc
from thermocomp.cli.app import run
from thermocomp.core.exceptions import FitError, InputError, MissingExtraError
from thermocomp.judging import cluster as clusters
from thermocomp.judging import selecting, splits
from thermocomp.judging.choice import Settings
from thermocomp.judging.compare import compare
from thermocomp.judging.pieces import work_through
from thermocomp.judging.results import Comparison
from thermocomp.judging.sharing import shared_among
from thermocomp.models.ols import LeastSquares
from thermocomp.papers import cross, studies
from thermocomp.recordings.samples import Samples


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[DaskCluster]:
    """Two workers; what dies with one of them is not tried again but alone."""
    with dask_cluster(tmp_path_factory.mktemp("dask"), DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES="0") as found:
        yield found


def assert_same(one: Comparison, other: Comparison) -> None:
    for mine, its in zip(one.assessments, other.assessments, strict=True):
        assert (mine.target, mine.model, mine.block) == (its.target, its.model, its.block)
        assert (mine.word, mine.reason, mine.sensors) == (its.word, its.reason, its.sensors)
        np.testing.assert_array_equal(mine.predicted, its.predicted)
        if mine.robustness is not None and its.robustness is not None:
            assert mine.robustness.worst_lost == its.robustness.worst_lost
    assert one.recommended == other.recommended


def test_a_comparison_is_the_same_as_here(running: DaskCluster) -> None:
    told: dict[str, list[str]] = {"there": [], "here": []}
    work = (small_machine(), "z_um", ["ols", "mra"])
    there = tc.compare(*work, scheduler=running.address, progress=told["there"].append)
    here = tc.compare(*work, jobs=2, progress=told["here"].append)
    assert_same(there.comparison, here.comparison)
    assert told["there"] == told["here"]
    assert len(told["here"]) == 2 * 4 + 2 * 6


@pytest.mark.parametrize(
    ("method", "settings"), [("pareto", Settings(models=["ols"], max_sensors=2)), ("ace", Settings())]
)
def test_sensors_are_the_same_as_here(method: str, settings: Settings, samples: Samples, running: DaskCluster) -> None:
    judging = splits.leave_one_cycle_out(samples)
    told: list[str] = []

    def tell(text: str, /, steps: int = 1) -> None:
        told.extend([text] * steps)

    with shared_among(running.address):
        there = selecting.select(method, samples, judging, settings, progress=tell)
    here = selecting.select(method, samples, judging, settings, jobs=2)
    assert [(c.sensors, c.reason, c.tables, c.notes) for c in there] == [
        (c.sensors, c.reason, c.tables, c.notes) for c in here
    ]
    assert len(told) == selecting.n_pieces(method, samples, judging, settings)


def test_one_search_stays_here(samples: Samples, running: DaskCluster) -> None:
    with (
        shared_among(running.address),
        pytest.raises(InputError, match="subsets does not support a scheduler"),
    ):
        selecting.select("subsets", samples, splits.leave_one_cycle_out(samples), Settings())


def test_methods_on_the_experiments_are_the_same_as_here(running: DaskCluster) -> None:
    how: dict[str, Any] = {"methods": ["ols"], "experiments": cross.EXPERIMENTS[4:5]}
    with shared_among(running.address):
        there = cross.run(0, **how)
    assert there.numbers == cross.run(0, **how).numbers
    assert len(there.numbers) == 2


@pytest.mark.long
def test_the_runs_of_a_study_are_the_same_as_here(running: DaskCluster) -> None:
    told: list[tuple[float, str]] = []
    one = studies.repeat("hwang", repeats=2)
    two = studies.repeat("hwang", repeats=2, jobs=2)
    with shared_among(running.address):
        there = studies.repeat("hwang", repeats=2, progress=lambda done, text: told.append((done, text)))
        with pytest.raises(FitError, match=r"ModuleNotFoundError: No module named 'thermocomp.papers.nonesuch'"):
            studies.repeat("nonesuch")
    same = [[c for c in study.claims if "H-19" not in c.ids] for study in (one, two, there)]  # that one has times
    assert same[0] == same[1] == same[2]
    assert len(same[0]) == len(one.claims) - 1
    assert one.numbers == two.numbers == there.numbers
    assert told == [(0.5, "run 1 of 2"), (1.0, "run 2 of 2")]


class Deadly(LeastSquares):
    """Kills the process that fits it."""

    def fit(self, X: Any, y: Any) -> "Deadly":
        os.kill(os.getpid(), signal.SIGKILL)
        return self


class Unsendable(LeastSquares):
    """Cannot be sent to another process."""

    def __getstate__(self) -> Any:
        raise TypeError("cannot pickle it")


@pytest.mark.long
def test_what_fails_costs_its_method_alone(samples: Samples, running: DaskCluster) -> None:
    judging = splits.parse("0.75/0.25", samples)
    alone = compare(samples, ["ols", "dynamic"], judging, robustness=False)
    told: list[str] = []
    with shared_among(running.address):
        found = compare(
            samples, ["ols", Deadly(), "dynamic", Unsendable()], judging, robustness=False, progress=told.append
        )
    assert len(told) == 8
    for k in range(2):
        first, deadly, last, unsendable = found.overall()[4 * k : 4 * k + 4]
        assert deadly.reason == (
            "could not be judged: its process ended: it crashed, or was killed by the system, for example "
            "because the memory is full"
        )
        assert "it cannot be sent to another process: TypeError: cannot pickle it" in unsendable.reason
        for mine, its in zip((first, last), alone.overall()[2 * k : 2 * k + 2], strict=True):
            np.testing.assert_array_equal(mine.predicted, its.predicted)


def threads_of(_: int) -> Any:
    from joblib import effective_n_jobs
    from threadpoolctl import threadpool_info

    return {lib["num_threads"] for lib in threadpool_info()}, effective_n_jobs(-1)


def fails(_: int) -> Any:
    raise ValueError("on purpose")


def test_a_worker_calculates_on_one_thread(running: DaskCluster) -> None:
    with shared_among(running.address):
        assert list(work_through(threads_of, range(2), lost, jobs=1)) == [({1}, 1)] * 2
        assert list(work_through(fails, [0], lost, jobs=1)) == ["ValueError: on purpose"]
        assert list(work_through(slow, [], lost, jobs=1)) == []


def test_the_keyboard_takes_the_tasks_off_the_scheduler(running: DaskCluster) -> None:
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job ignores the keyboard
    with Client(running.address) as watching:

        def known() -> int:
            count: int = watching.run_on_scheduler(
                lambda dask_scheduler: sum(str(key).startswith("thermocomp") for key in dask_scheduler.tasks)
            )
            return count

        with shared_among(running.address):
            going = work_through(slow, range(100), lost, jobs=1)
            assert next(going) == 0
            wait_until(lambda: known() > 50)
            Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
            with pytest.raises(KeyboardInterrupt):
                list(going)
            wait_until(lambda: known() == 0)
            abandoned = work_through(slow, range(100), lost, jobs=1)
            assert next(abandoned) == 0
        wait_until(lambda: known() == 0)
    del abandoned  # its client is closed: nothing is raised
    signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize("address", ["10.0.0.1:8786", "tcp://host", "http://host:8786", "tcp://host:port", ""])
def test_what_is_no_address(address: str) -> None:
    with pytest.raises(InputError, match="expected the address that 'dask scheduler' prints"), shared_among(address):
        pass


@pytest.mark.parametrize("listens", [True, False])
def test_no_scheduler_there(listens: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clusters, "ANSWERS", 1.0)
    with closing(socket.socket()) as held:
        held.bind(("127.0.0.1", 0))
        if listens:
            held.listen()
        address = f"tcp://127.0.0.1:{held.getsockname()[1]}"
        begun = time.monotonic()
        with (
            pytest.raises(InputError, match=f"{address}: no Dask scheduler answers there"),
            shared_among(address),
        ):
            pass
        assert time.monotonic() - begun < 5


def test_without_dask(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "thermocomp.judging.cluster")
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'thermocomp\[dask\]'"), shared_among("tcp://here:1"):
        pass


def test_other_versions_and_no_workers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clusters, "WORKERLESS", 1.0)
    other = tmp_path / "thermocomp-9.9.9.dist-info"
    other.mkdir()
    (other / "METADATA").write_text("Metadata-Version: 2.1\nName: thermocomp\nVersion: 9.9.9\n")
    with dask_cluster(tmp_path, workers=0) as cluster:
        with (
            pytest.raises(
                InputError, match=f"{cluster.address}: the scheduler has no worker; start some with: dask wo"
            ),
            shared_among(cluster.address),
        ):
            pass
        monkeypatch.undo()
        cluster.start_worker("--no-nanny", folders=(tmp_path,))
        with (
            pytest.raises(InputError, match=rf"worker tcp://.*: thermocomp 9.9.9 \(here {tc.__version__}\); install"),
            shared_among(cluster.address),
        ):
            pass


def test_another_python_is_named() -> None:
    here = clusters._alike({"python": "3.11.7.final.0", "numpy": "2.1.0"})
    clusters._check_versions(here, clusters._alike({"python": "3.11.9.final.0", "numpy": "2.1.0"}), "tcp://a:1")
    with pytest.raises(InputError, match=r"tcp://a:1: python 3.12 \(here 3.11\), numpy is missing \(here 2.1.0\)"):
        clusters._check_versions(here, clusters._alike({"python": "3.12.1.final.0"}), "tcp://a:1")


@pytest.mark.parametrize("how", [signal.SIGKILL, pytest.param(signal.SIGSTOP, marks=pytest.mark.long)])
def test_a_lost_scheduler(
    how: signal.Signals, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(clusters, "ASKED", 1.0)
    monkeypatch.setattr(clusters, "ANSWERS", 1.0)
    with dask_cluster(tmp_path, workers=1) as cluster:
        assert cluster.scheduler is not None
        with shared_among(cluster.address):
            going = work_through(slow, range(100), lost, jobs=1)
            assert next(going) == 0
            cluster.scheduler.send_signal(how)
            begun = time.monotonic()
            with pytest.raises(InputError, match=f"{cluster.address}: the connection to the scheduler was lost"):
                list(going)
            assert time.monotonic() - begun < 5
    assert "Traceback" not in capfd.readouterr().err  # of Dask's loggers


@pytest.mark.long
def test_lost_workers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clusters, "ASKED", 1.0)
    with dask_cluster(tmp_path, workers=0) as cluster:
        cluster.start_worker("--no-nanny")
        with shared_among(cluster.address):
            going = work_through(slow, range(100), lost, jobs=1)
            assert next(going) == 0
            cluster.nannies[0].kill()
            with pytest.raises(InputError, match=f"{cluster.address}: the scheduler has no worker"):
                list(going)


@pytest.mark.parametrize("command", ["compare", "select", "fit", "papers"])
def test_the_commands_take_it(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    small_machine().table.assign(time_s=lambda t: 60.0 * t.index).to_csv("day.csv", index=False)
    words = [] if command == "papers" else ["day.csv", "--target", "z_um", "--inputs", "t1_C"]
    words += ["-o", "model.json"] if command == "fit" else []
    assert run([command, *words, "--scheduler", "tcp://127.0.0.1:1"]) == 2
    told = capsys.readouterr().err
    assert "error: tcp://127.0.0.1:1: no Dask scheduler answers there" in told
    assert "check that 'dask scheduler' is running" in told

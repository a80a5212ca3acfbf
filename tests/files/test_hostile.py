"""Damaged and hostile recordings: each is read or refused by thermocomp's own errors, in bounded time and memory."""

import multiprocessing
import random
import signal
import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import pytest
from hostile_files import HOSTILE, bases, damaged, try_file

#: made in the long test alone: seconds of work each
HEAVY = {
    *(
        "numbers",
        "empty rows",
        "strings",
        "more strings",
        "styles",
        "columns",
        "starts",
        "labels",
        "zip bomb",
        "long text",
        "digits",
    ),
    *(
        "parquet dictionary",
        "parquet zeros",
        "parquet rows",
        "blank lines",
        "comments",
        "quotes",
        "long rows",
        "spaces",
    ),
    *("wide empty rows", "empty cells", "one row", "ods rows", "ods wide", "columns of odd units", "many styles"),
}
SECONDS, MEGABYTES = 10.0, 1024


def _try_seed(seed: int, sound: dict[str, bytes]) -> tuple[float, int, str]:
    ending, content = damaged(seed, sound)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"damaged{seed}.{ending}"
        path.write_bytes(content)
        return try_file(path)


def test_the_files_that_are_damaged_are_sound(tmp_path: Path) -> None:
    for ending, content in bases().items():
        path = tmp_path / f"sound.{ending}"
        path.write_bytes(content)
        assert try_file(path)[2] == ""


@pytest.mark.parametrize("name", sorted(set(HOSTILE) - HEAVY))
def test_a_hostile_file_is_read_or_refused(tmp_path: Path, name: str) -> None:
    ending, make = HOSTILE[name]
    path = tmp_path / f"hostile.{ending}"
    path.write_bytes(make())

    said = try_file(path)[2]

    assert not said or "hostile" in said


def test_some_damaged_files_are_read_or_refused() -> None:
    sound = bases()
    said = [_try_seed(seed, sound)[2] for seed in range(200)]

    assert 50 < sum(map(bool, said)) < 195  # neither all too damaged nor all sound


@pytest.mark.long
def test_5000_files_within_10_seconds_and_a_gigabyte(tmp_path: Path) -> None:
    sound, broken, slowest, largest = bases(), list[str](), 0.0, 0
    jobs: dict[str, Path | int] = {}
    for name, (ending, make) in HOSTILE.items():
        jobs[name] = tmp_path / f"{name.replace(' ', '_')}.{ending}"
        (tmp_path / f"{name.replace(' ', '_')}.{ending}").write_bytes(make())
    jobs |= {f"seed {k}": k for k in range(5_000 - len(jobs))}
    order = sorted(jobs)
    random.Random(1).shuffle(order)  # a worker meets what comes after a hostile file, too
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(2, context, initializer=signal.alarm, initargs=(3000,)) as pool:
        found = {}
        for name in order:
            job = jobs[name]
            found[name] = pool.submit(_try_seed, job, sound) if isinstance(job, int) else pool.submit(try_file, job)
        for name, future in found.items():
            error = future.exception()
            if error is not None:
                broken.append(f"{name}: {error!r}")
                continue
            seconds, megabytes, _ = future.result()
            slowest, largest = max(slowest, seconds), max(largest, megabytes)
            if seconds > SECONDS or megabytes > MEGABYTES:
                broken.append(f"{name}: {seconds:.1f} s, {megabytes} MB")
    print(f"{len(found)} files, {len(broken)} broken, slowest {slowest:.1f} s, {largest} MB")
    assert not broken

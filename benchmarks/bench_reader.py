"""Reading a long recording: processor time compared with pandas, and peak memory relative to the resulting table.

Run it with ``python benchmarks/bench_reader.py [ROWS]``. Goal: a million rows in seconds, with peak memory of at most
2.5 times the float64 table. For pandas the format of the file is specified, and nothing is checked.
"""

# The parent imports no large package: on Linux a child's ru_maxrss starts at the size of the process that forked it.
import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

CHANNELS = 19
LIMIT = 2.5
KINDS = ("seconds, ','", "timestamps, ';', decimal comma", "parquet")


def make(path: Path, rows: int, kind: str) -> None:
    """Write a synthetic test: a spindle that runs and stops, and temperatures with noise."""
    import numpy as np
    import pandas as pd

    random = np.random.default_rng(1)
    seconds = np.arange(rows) * 1.0
    data = {"spindle_rpm": np.where(seconds % 28800 < 14400, 3000.0, 0.0)}
    for k in range(1, CHANNELS):
        drift = np.cumsum(random.normal(scale=0.003, size=rows))
        data[f"t{k}_C"] = np.round(20 + drift + random.normal(scale=0.02, size=rows), 6)
    table = pd.DataFrame(data)
    if kind == KINDS[1]:
        table.insert(
            0, "timestamp", pd.date_range("2024-03-31T00:00:00", periods=rows, freq="s").strftime("%Y-%m-%d %X")
        )
        table.to_csv(path, index=False, sep=";", decimal=",")
        return
    table.insert(0, "time_s", seconds)
    if kind == KINDS[0]:
        table.to_csv(path, index=False)
    else:
        table.to_parquet(path, index=False)


def measure(path: Path) -> dict[str, float]:
    """Read and check a file; sizes in bytes, times in seconds."""
    from thermocomp.recordings.checks.quality import check
    from thermocomp.recordings.readers.recordings import read

    def peak() -> int:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024

    before = peak()
    began = time.process_time()
    recording = read(path)
    read_s = time.process_time() - began
    memory = peak() - before
    began = time.process_time()
    check(recording)
    table = len(recording) * (len(recording.channels) + 1) * 8
    return {
        "rows": len(recording),
        "read": read_s,
        "check": time.process_time() - began,
        "table": table,
        "memory": memory,
    }


def measure_pandas(path: Path, kind: str) -> float:
    """Return the processor time of pandas alone [s]."""
    import pandas as pd

    began = time.process_time()
    if kind == KINDS[0]:
        pd.read_csv(path)
    elif kind == KINDS[1]:
        pd.to_datetime(pd.read_csv(path, sep=";", decimal=",")["timestamp"])
    else:
        pd.read_parquet(path)
    return time.process_time() - began


def child(*arguments: str) -> str:
    command = [sys.executable, __file__, *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def main(rows: int) -> int:
    """Print one line per kind of file; return 1 if one needs more memory than the limit."""
    print(
        f"{'file':32} {'rows':>9} {'MB':>6} {'read s':>7} {'pandas s':>8} {'ratio':>5} {'check s':>7} {'table MB':>8} "
        f"{'peak/table':>10}"
    )
    worst = 0.0
    with tempfile.TemporaryDirectory() as folder:
        for kind in KINDS:
            path = Path(folder) / ("bench.parquet" if kind == "parquet" else "bench.csv")
            child("--make", str(path), str(rows), kind)
            plain = float(child("--pandas", str(path), kind))
            found = json.loads(child("--measure", str(path)))
            ratio = found["memory"] / found["table"]
            worst = max(worst, ratio)
            print(
                f"{kind:32} {found['rows']:9.0f} {path.stat().st_size / 1e6:6.0f} {found['read']:7.2f} "
                f"{plain:8.2f} {found['read'] / plain:5.1f} {found['check']:7.2f} {found['table'] / 1e6:8.0f} "
                f"{ratio:10.2f}"
            )
    print(f"peak memory at most {LIMIT:g} times the table: {'yes' if worst <= LIMIT else 'NO'}")
    return int(worst > LIMIT)


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["--make", where, n_rows, what]:
            make(Path(where), int(n_rows), what)
        case ["--measure", where]:
            print(json.dumps(measure(Path(where))))
        case ["--pandas", where, what]:
            print(measure_pandas(Path(where), what))
        case other:
            sys.exit(main(int(other[0]) if other else 1_000_000))

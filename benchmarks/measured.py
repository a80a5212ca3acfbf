"""Measured recordings for the benchmarks: in ``../shared/data``, or in the folder that ``THERMOCOMP_DATA`` names."""

import os
from pathlib import Path

SHARED = Path(__file__).resolve().parents[2] / "shared" / "data"


def find_measured(name: str) -> Path | None:
    """Return the path of a file or folder of the measured data; None, and a line of output, if it is missing."""
    path = Path(os.environ.get("THERMOCOMP_DATA", SHARED)) / name
    if path.exists():
        return path
    print(f"skipped: {path} is missing; set THERMOCOMP_DATA to the folder of the measured data", flush=True)
    return None

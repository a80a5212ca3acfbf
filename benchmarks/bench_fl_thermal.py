"""fl_thermal, measured on a real machine: the published test block, beside the published models.

Run with ``python benchmarks/bench_fl_thermal.py``. Rows 0-6668 are learned from, rows 6669-8891 are the published test
block. Published figures: FL_THERMAL (GitHub CAIVIAC/FL_THERMAL). Skipped where the measured data are absent.
"""

import os
import sys
import time
from pathlib import Path

import numpy as np

from thermocomp.assessment.compare import compare
from thermocomp.core.zero import FIRST_READING
from thermocomp.files import recordings
from thermocomp.recording import splits
from thermocomp.recording.stacking import stack

PUBLISHED = {
    "least squares (published)": (9.25, 7.62, 11.86, 12.09, 5.24),
    "random forest (published)": (6.46, 4.50, 7.33, 7.18, 12.44),
    "XGBoost/AutoML (published)": (5.61, 4.97, 6.04, 7.80, 9.54),
    "GRU with attention (published best)": (3.56, 3.76, 3.70, 3.46, 4.28),
}
BEST = PUBLISHED["GRU with attention (published best)"]
GOAL_MEAN = 1.9


def main() -> int:
    shared = Path(__file__).resolve().parents[2] / "shared" / "data"
    path = Path(os.environ.get("THERMOCOMP_DATA", shared)) / "fl_thermal" / "recording.csv"
    if not path.is_file():
        print(f"skipped: {path} is not here; set THERMOCOMP_DATA to the folder of the measured data")
        return 0
    begin = time.perf_counter()
    targets = [f"ch{k}_um" for k in range(1, 6)]
    samples = stack([recordings.read(path)], targets, zeroing=FIRST_READING)  # as in the published study
    methods = ["ols", "partial-f", "mra", "dynamic"]
    result = compare(samples, methods, splits.parse("0.75/0.25", samples), robustness=False, jobs=-1)
    seconds = time.perf_counter() - begin
    print(f"mean absolute error [um] on {result.assessments[0].block}; read, fit and replay took {seconds:.1f} s")
    print(f"{'':<38}" + "".join(f"{t.removesuffix('_um'):>8}" for t in targets) + f"{'mean':>8}")
    errors = {m: [a.metric("mae") for a in result.overall() if a.model == m] for m in methods}
    none = [a.none_metric("mae") for a in result.overall() if a.model == "ols"]
    for name, values in {"none": none, **PUBLISHED, **errors}.items():
        print(f"{name:<38}" + "".join(f"{v:>8.2f}" for v in values) + f"{np.mean(values):>8.2f}")
    dynamic = errors["dynamic"]
    reached = np.mean(dynamic) <= GOAL_MEAN and all(d < b for d, b in zip(dynamic, BEST, strict=True))
    print(
        f"goal, dynamic: mean <= {GOAL_MEAN} um and every channel below the published best: "
        f"{'reached' if reached else 'MISSED'}"
    )
    return 0 if reached else 1


if __name__ == "__main__":
    sys.exit(main())

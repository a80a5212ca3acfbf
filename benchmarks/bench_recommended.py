"""Recommended methods on recordings that no part of the choice has seen: error in use beside the least of the accepted.

Run with ``python benchmarks/bench_recommended.py [CASE ...]``. The protocol, fixed before the first run: of each
recording about 700 rows and at most two targets, the seeds below, `compare` with the defaults; each accepted method
is fitted as well, and all are assessed on the unseen recordings. The error in use is that of the models as written:
with clean readings, with noise as estimated from the training recording, and with a sensor lost. Goals: `fit` and
`compare` agree; at most 1.1 times the least of the accepted in eight of ten recordings; never above the error without
compensation plus the margin of harm.
"""

import os
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal

import numpy as np

import thermocomp as tc
from thermocomp.recordings.cycles import Cycle
from thermocomp.recordings.recording import Recording
from thermocomp.virtual.protocol import Physics

DATA = Path(os.environ.get("THERMOCOMP_DATA", Path(__file__).resolve().parents[2] / "shared" / "data"))
VORON = DATA / "voron_frame" / "frame_exp_quant_v3_2021-06-13_05-41-53.csv"
VORON_MAPPING = Path(__file__).resolve().parents[1] / "docs" / "files" / "voron.toml"
#: rows of a recording, targets, largest ratio and in how many recordings, offset of the second logger's clock [s]
ROWS, TARGETS, GOAL, RECORDINGS, OFFSET = 700, 2, 1.1, 8, 460.0

Pair = tuple[list[Recording], list[Recording]]


def rows(found: Recording, keep: slice) -> Recording:
    """Return rows of a recording, in its own thermal cycles."""
    chosen = np.arange(len(found))[keep]
    ends = [(c, np.searchsorted(chosen, [c.start, c.stop])) for c in found.cycles]
    cycles = [Cycle(c.name, int(a), int(b)) for c, (a, b) in ends if b > a]
    moments = found.time[chosen]
    return replace(found, time=moments - moments[0], table=found.table.iloc[chosen], cycles=tuple(cycles))


def thin(found: Sequence[Recording]) -> list[Recording]:
    """Return the recordings with about `ROWS` rows together."""
    every = max(1, round(sum(map(len, found)) / ROWS))
    return [rows(f, slice(None, None, every)) for f in found]


def virtual(learned: str, judged: str | None = None, seed: int = 0, physics: Physics | None = None) -> Pair:
    """Record an experiment, and another one, or the same, with another seed."""
    first, other = (
        tc.simulate(e, seed=s, physics=physics) for e, s in ((learned, seed), (judged or learned, seed + 1))
    )
    return first, other


def days() -> Pair:
    """Return the five days of Wessel's milling machine: the last is unseen."""
    *first, last = tc.simulate("wessel-milling", seed=31)
    return first, [last]


def fl_thermal() -> Pair:
    """Return the first seven tenths of the measured machine, up to the start of a cycle, and the rest."""
    whole = tc.read(DATA / "fl_thermal" / "recording.csv")
    begin = min((c.start for c in whole.cycles), key=lambda row: abs(row - 0.7 * len(whole)))
    return [rows(whole, slice(begin))], [rows(whole, slice(begin, None))]


def voron() -> Pair:
    """Return the first half of the printer's log, and the second."""
    whole = tc.read(VORON, VORON_MAPPING)
    return [rows(whole, slice(len(whole) // 2))], [rows(whole, slice(len(whole) // 2, None))]


def workbook() -> Pair:
    """Write a recording as a workbook, and read it."""
    (found,), unseen = virtual("random", seed=41)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "drift.xlsx"
        found.to_frame().to_excel(path, index=False)
        return [tc.read(path)], unseen


def loggers() -> Pair:
    """Return the demo as two loggers recorded it, joined, and as one logger recorded another week."""
    (found,), unseen = virtual("demo", seed=51)
    table = found.to_frame()
    probes = [c.name for c in found.displacements]
    second = table[["time_s", "spindle_rpm", *probes]].assign(time_s=table["time_s"] + OFFSET)
    return [tc.join([table.drop(columns=probes), second]).recording], unseen


CASES: dict[str, Callable[[], Pair]] = {
    "demo": lambda: virtual("demo", seed=11),
    "nonlinear": lambda: virtual("demo", seed=21, physics="nonlinear"),
    "fl_thermal": fl_thermal,
    "voron": voron,
    "workbook": workbook,
    "stepwise2017": lambda: virtual("stepwise2017", seed=61),
    "wessel-milling": days,
    "chen1996": lambda: virtual("chen1996", "chen1996-new", seed=71),
    "hwang": lambda: virtual("hwang", seed=81),
    "loggers": loggers,
}


def judge(name: str) -> tuple[float, bool]:
    """Print the errors in use on unseen recordings; return the largest ratio, and whether none harms and all agree."""
    begun = time.perf_counter()
    learned, unseen = (thin(r) for r in CASES[name]())
    shared = [c.name for c in learned[0].displacements if all(r.has(c.name) for r in unseen)]
    targets = shared[-TARGETS:]
    single = len(learned) == 1 and len(learned[0].cycles) == 1
    unit: Literal["file", "cycle"] | None = None if single else "file" if len(learned) > 1 else "cycle"
    found = tc.compare(learned, targets, jobs=1, split="0.75/0.25" if single else None, leave_one=unit)
    noise, ratio, fine = found.comparison.noise, 1.0, True
    written = {m.target: m for m in found.fit().fitted.models}
    methods = {t: m.provenance.method for t, m in written.items() if m.provenance}
    for target in targets:
        accepted = [a.model for a in found.comparison.overall() if a.target == target and a.accepted and a.deployable]
        best, model = found.best[target], written.get(target)
        fine &= best is None or methods.get(target) == best
        if best is None or model is None:
            print(f"{name} {target}: none accepted; written: {methods.get(target)}", flush=True)
            continue
        errors, none, margin = {}, 0.0, 0.0
        for method in accepted:
            fitted = (
                model
                if method == best
                else next(m for m in found.fit({target: method}).fitted.models if m.target == target)
            )
            (judged,) = tc.assess([fitted], unseen).judged.overall()
            errors[method] = judged.in_use(noise).rms
            none, margin = judged.none_metric("rms"), max(u.margin for u in judged.verdict.units)
        least = min(errors, key=errors.__getitem__)
        fine &= errors[best] <= none + margin
        ratio = max(ratio, errors[best] / errors[least])
        print(
            f"{name} {target}: {best} {errors[best]:.3f}, least {least} {errors[least]:.3f}, none {none:.2f} um",
            flush=True,
        )
    print(f"{name}: {ratio:.2f} times the least, {time.perf_counter() - begun:.0f} s", flush=True)
    return ratio, fine


def main() -> int:
    results = [judge(name) for name in sys.argv[1:] or CASES]
    within = sum(ratio <= GOAL for ratio, _ in results)
    print(
        f"{within} of {len(results)} recordings within {GOAL} times the least; "
        f"{sum(f for _, f in results)} agree and do no harm"
    )
    return int(within < RECORDINGS or not all(f for _, f in results))


if __name__ == "__main__":
    sys.exit(main())

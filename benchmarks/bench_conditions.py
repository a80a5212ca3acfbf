"""NC programs: true errors of revised programs against the bound and what its conditions add (``thermocomp revise``).

Run with ``python benchmarks/run.py conditions``; a minute of processor time. Plants that are exactly linear, models of
noisy tests, programs of about an hour with stops, tool changes and dwells. Protocol, before the first run: no error of
a true run is beyond its printed range; each range of a condition is at most 1.5 times the largest error at its ends.
"""

import tempfile
from pathlib import Path

from nc_conditions import TRUTHS, largest, table

SEEDS = (7301, 7302, 7303, 7304, 7305)
WIDEST = 1.5


def main() -> int:
    beyond, wide, ranges = [], [], 0
    print("  seed  condition     worst at  axis  error  printed  ratio  condition adds  it did add   (um)")
    for seed in SEEDS:
        with tempfile.TemporaryDirectory() as folder:
            rows = table(seed, Path(folder), TRUTHS)
        beyond += [row for row in rows if row.error > row.printed]
        for row in largest(rows):
            ratio = row.printed / row.error
            ranges += row.kind != "as assumed"
            wide += [row] if ratio > WIDEST and row.kind != "as assumed" else []
            print(
                f"{row.seed:>6}  {row.kind:12} {row.value:>9g}  {row.axis:>4} {row.error:6.2f} {row.printed:8.2f} "
                f"{ratio:6.2f} {row.adds:15.2f} {row.more:11.2f}",
                flush=True,
            )
    print(f"{len(beyond)} errors beyond the range; {len(wide)} of {ranges} ranges wider than {WIDEST} times")
    return int(bool(beyond or wide))


if __name__ == "__main__":
    raise SystemExit(main())

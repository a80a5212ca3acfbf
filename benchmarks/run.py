"""Run all benchmarks, one after the other, each in a separate process with one thread for linear algebra.

Run with ``python benchmarks/run.py [NAME ...]``, such as ``stepwise online``. Exit code 1 if a goal is missed.
"""

import os
import subprocess
import sys
from pathlib import Path

#: run only if named: they take hours, or do not measure speed
BY_HAND = ("verdict", "recommended", "stable", "bands", "plan", "watch", "linuxcnc", "warm_start", "vectors")


def main() -> int:
    here = Path(__file__).resolve().parent
    wanted = sys.argv[1:]
    names = {p.stem.removeprefix("bench_"): p for p in sorted(here.glob("bench_*.py"))}
    scripts = [p for name, p in names.items() if (name in wanted if wanted else name not in BY_HAND)]
    helpers = os.pathsep.join(filter(None, (str(here.parent / "tests" / "helpers"), os.environ.get("PYTHONPATH"))))
    environment = {**os.environ, "PYTHONPATH": helpers, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    missed = []
    for script in scripts:
        print(f"\n== {script.stem.removeprefix('bench_')}", flush=True)
        if subprocess.run([sys.executable, str(script)], env=environment, check=False).returncode:
            missed.append(script.stem.removeprefix("bench_"))
    print(f"\ngoals missed in: {', '.join(missed)}" if missed else "\nall goals reached")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())

"""Mutants of exported code: whether the exported test notices a small change of code or tables.

Run with ``python benchmarks/run.py vectors`` or ``python benchmarks/bench_vectors.py [--model MODEL] [--seed N]
[--mutants N] [--language c|st]``; C needs gcc, structured text is run by the interpreter of the tests (needs blark).
Mutants are drawn by a seed (`code_mutants.draw`); each is compiled and the exported test is run. One that survives is
run through other worlds: random readings with random faults, with the answers of the compensator. Differs it there, it
is counted as missed; otherwise it is printed as one without an effect that was found, to be argued. Goal: at most 5 %
are missed.
"""

import argparse
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from code_mutants import Language, Mutant, draw
from thermocomp.core.correction import Limits
from thermocomp.core.model import ErrorModel
from thermocomp.core.provenance import RULES, HonestError
from thermocomp.export.c99 import package as c99
from thermocomp.export.c99.ctest import write_test as write_program
from thermocomp.export.facts import Facts
from thermocomp.export.scenarios import make_readings
from thermocomp.export.st.structuredtext import SourceUnit, translate
from thermocomp.export.st.sttest import write_test
from thermocomp.export.vectors import DAMAGED, NOTHING, RETAINED, REZERO, TOLD_COLD, Readings, replay
from thermocomp.export.warming import Warming
from thermocomp.files.machines import read_models
from thermocomp.models.training import train
from thermocomp.models.watching import find_watch
from thermocomp.recordings.stacking import stack
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.program.tables import Tables, gather
from thermocomp.virtual.datasets import record

MUTANTS, SEED, WORLDS, CALLS, ALLOWED = 100, 1, 12, 1200, 0.05
LANGUAGES = ("c", "st")
PATIENCE = 60.0
HONEST = HonestError("made up", 1.0, 1.0, 2.0, 5.0, 5.0, {}, "accepted", "so that it runs", rules=RULES)
FACTS = Facts("model.json", "0" * 64, "0", "2026-01-01", {})
NAME = "tc_bench"


def demo_models() -> list[ErrorModel]:
    """Return averaged models of the targets of the demo, with its watch."""
    (found,) = record("demo")
    samples = stack([found], [c.name for c in found.channels if c.quantity == "displacement"])
    every = np.ones(len(samples), np.bool_)
    watch, targets = find_watch(samples, every), range(len(samples.targets))
    return [replace(train("averaged", samples, k, every).model, watch=watch, honest_error=HONEST) for k in targets]


def draw_world(tables: Tables, seed: int) -> Readings:
    """Draw readings of a machine with random speeds, faults, clocks, counters and power-ups."""
    rng, draws = np.random.default_rng(seed), random.Random(seed)
    machine, n = Warming(tables), len(tables.channels)
    rows, orders = list[tuple[np.ndarray, float, float, float]](), list[tuple[int, float]]()
    offset, bad = np.zeros(n), dict[int, tuple[str, float]]()
    counter, share = 0.0, 0.0
    pace = draws.choice((5.0, 10.0, 20.0, 60.0))
    before = machine.rest
    for k in range(CALLS):
        if rng.random() < 0.05:
            share = draws.choice((0.0, 0.0, 0.3, 0.6, 1.0, 1.2))
        if rng.random() < 0.02:
            pace = draws.choice((1.0, 5.0, 10.0, 20.0, 60.0, 300.0, 700.0))
        dt = pace if rng.random() < 0.97 else draws.choice((0.0, -1.0, np.nan, 3600.0, 2 * pace))
        values = machine.run(share, dt if 0.0 < dt < 1e5 else 0.0)
        true = values.copy()
        values += np.where(machine.heat, 0.003 * rng.standard_normal(n), 0.0)
        if rng.random() < 0.02:
            c = int(rng.integers(n))
            bad[c] = (
                draws.choice(("gone", "stuck", "shifted", "drift", "noise", "swap", "half")),
                float(rng.normal(0, 8)),
            )
        if rng.random() < 0.03:
            bad, offset = {}, np.zeros(n)
        for c, (how, size) in bad.items():
            other = int(abs(size) * 1e3) % n
            offset[c] += size * dt / 3600.0 if how == "drift" and 0.0 < dt < 1e5 else 0.0
            values[c] = {
                "gone": np.nan,
                "stuck": before[c],
                "shifted": values[c] + size,
                "drift": values[c] + offset[c],
                "noise": values[c] + rng.normal(0, abs(size)),
                "swap": true[other] if machine.heat[c] else values[c],
                "half": values[c] * 0.5 if not machine.heat[c] else values[c],
            }[how]
            if how == "swap" and machine.heat[c] and machine.heat[other]:
                values[other] = true[c]
        before = values
        age = 0.0 if rng.random() < 0.96 else draws.choice((5.0, 59.0, 61.0, -0.5, -2.0))
        counter = (
            0.0 if rng.random() < 0.01 else counter + (rng.random() < 0.9) if counter or rng.random() < 0.01 else 0.0
        )
        event, amount = (TOLD_COLD, 0.0) if k == 0 else (NOTHING, 0.0)
        if rng.random() < 0.02 and k and rows[-1][2] >= 10.0:  # a block retains its state every ten seconds
            event = draws.choice(
                (RETAINED, RETAINED, DAMAGED, TOLD_COLD, REZERO + int(rng.integers(len(tables.targets))))
            )
            amount = draws.choice((0.0, 60.0, 1800.0, 7200.0, 1e5)) if event < TOLD_COLD else float(rng.normal(0, 5))
        rows.append((np.round(values, 4), age, dt, counter))
        orders.append((event, amount))
    values, ages, steps, counters = (np.array([r[j] for r in rows], dtype=np.float64) for j in range(4))
    return Readings(
        values=values,
        age=ages,
        dt=steps,
        counter=counters,
        event=np.array([e for e, _ in orders]),
        amount=np.array([a for _, a in orders], dtype=np.float64),
    )


class InC:
    """The exported package in C, and tests in other worlds."""

    def __init__(self, compensator: Compensator, tables: Tables, worlds: int, folder: Path) -> None:
        self.folder = folder
        files = c99.write_package(compensator, NAME.removeprefix("tc_"), FACTS)
        for file, text in files.items():
            (folder / file).write_bytes(text)
        self.text = files[f"{NAME}.c"].decode()
        self.tests = [f"{NAME}_test.c"]
        for seed in range(worlds):
            readings = draw_world(tables, seed)
            answers = replay(compensator, tables, readings)
            self.tests.append(f"world{seed}.c")
            (folder / self.tests[-1]).write_text(write_program(NAME, tables, readings, answers, 1e-9, 0.0))
        for test in self.tests:
            subprocess.run(["gcc", "-std=c99", "-c", test], cwd=folder, check=True)
        self._original = self._compile(self.text)
        self.tests = [t for t in self.tests if t == self.tests[0] or self._passes(t)]  # no decision at its edge

    def _compile(self, text: str) -> bytes | None:
        (self.folder / f"{NAME}.c").write_text(text)
        command = ["gcc", "-std=c99", "-w", "-O1", "-c", f"{NAME}.c"]
        if subprocess.run(command, cwd=self.folder, capture_output=True, check=False).returncode:
            return None
        return (self.folder / f"{NAME}.o").read_bytes()

    def _passes(self, test: str) -> bool:
        objects = [f"{NAME}.o", f"{Path(test).stem}.o"]
        subprocess.run(["gcc", *objects, "-lm", "-o", "run"], cwd=self.folder, check=True)
        try:
            return not subprocess.run(
                ["./run"], cwd=self.folder, capture_output=True, timeout=PATIENCE, check=False
            ).returncode
        except subprocess.TimeoutExpired:
            return False

    def _sanitized(self) -> bool:
        flags = ["-std=c99", "-w", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover"]
        command = ["gcc", *flags, f"{NAME}.c", f"{NAME}_test.c", "-lm", "-o", "run"]
        subprocess.run(command, cwd=self.folder, check=True)
        return not subprocess.run(["./run"], cwd=self.folder, capture_output=True, check=False).returncode

    def judge(self, mutant: Mutant | None) -> str:
        """Return what happens to a mutant: noticed, same code, invalid, in which world it differs, or nothing."""
        compiled = self._compile(mutant.apply(self.text) if mutant else self.text)
        if compiled is None:
            return "invalid"
        if mutant and compiled == self._original:
            return "same code"
        if not self._passes(self.tests[0]):
            return "noticed"
        if mutant and not self._sanitized():
            return "noticed by the sanitizers"
        return next((f"MISSED, differs in {t}" for t in self.tests[1:] if not self._passes(t)), "no effect found")


class InStructuredText:
    """The exported package in structured text, and tests in other worlds."""

    def __init__(self, compensator: Compensator, tables: Tables, worlds: int) -> None:
        import stmachine

        for parsed in ("block_of", "declared"):
            setattr(stmachine, parsed, cache(getattr(stmachine, parsed)))
        self._machine = stmachine.Machine
        self._units = translate(tables, NAME, "codesys")
        self.text = "".join(unit.text("codesys") for unit in self._units)
        readings = [make_readings(tables), *(draw_world(tables, seed) for seed in range(worlds))]
        answers = [replay(compensator, tables, r) for r in readings]
        pairs = zip(readings, answers, strict=True)
        self._tests = [write_test(tables, NAME, "codesys", r, a, self._units) for r, a in pairs]

    def _passes(self, units: Sequence[SourceUnit], test: Sequence[SourceUnit]) -> bool:
        try:
            machine = self._machine([*units, *test])
            while not machine.memory.done and not machine.memory.wrong:
                machine.call()
        except (ArithmeticError, AssertionError, LookupError, TypeError, ValueError):
            return False
        return not machine.memory.wrong

    def judge(self, mutant: Mutant | None) -> str:
        """Return what happens to a mutant."""
        units, at = list[SourceUnit](), 0
        for unit in self._units:
            end = at + len(unit.text("codesys"))
            if mutant and at <= mutant.begin < end:
                units.append(_changed(unit, mutant._replace(begin=mutant.begin - at, end=mutant.end - at)))
            else:
                units.append(unit)
            at = end
        if not self._passes(units, self._tests[0]):
            return "noticed"
        missed = (k for k, test in enumerate(self._tests[1:]) if not self._passes(units, test))
        return next((f"MISSED, differs in world {k}" for k in missed), "no effect found")


def _changed(unit: SourceUnit, mutant: Mutant) -> SourceUnit:
    text = unit.text("codesys")
    for part in ("declaration", "statements"):
        begin = text.index(getattr(unit, part))
        if begin <= mutant.begin < begin + len(getattr(unit, part)):
            moved = mutant._replace(begin=mutant.begin - begin, end=mutant.end - begin)
            return replace(unit, **{part: moved.apply(getattr(unit, part))})
    raise ValueError(f"{mutant}: in no part of {unit.name}")


def measure(language: Language, text: str, judge: Callable[[Mutant | None], str], count: int, seed: int) -> bool:
    """Judge mutants; print those that survive, and the sums; return whether the goal is reached."""
    if (begin := judge(None)) != "no effect found":
        raise SystemExit(f"{language}: without a mutant {begin}")
    said: dict[str, int] = {}
    kinds: dict[str, list[int]] = {}
    for mutant in draw(text, language, count, seed):
        found = judge(mutant)
        said[found.split(",")[0]] = said.get(found.split(",")[0], 0) + 1
        if found in ("invalid", "same code"):
            continue
        kinds.setdefault(mutant.kind, []).append(found.startswith("noticed"))
        if not found.startswith("noticed"):
            print(f"  {found}: {mutant.tell(text)}", flush=True)
    share = said.get("MISSED", 0) / max(1, sum(map(len, kinds.values())))
    print(f"{language}, seed {seed}: {', '.join(f'{n} {what}' for what, n in sorted(said.items()))}")
    print("  noticed: " + ", ".join(f"{kind} {sum(k)} of {len(k)}" for kind, k in kinds.items()))
    print(f"  missed: {100 * share:.1f} %, goal {100 * ALLOWED:.0f} %", flush=True)
    return share <= ALLOWED


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--model", type=Path, help="model file; default: models of the demo")
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--mutants", type=int, default=MUTANTS)
    parser.add_argument("--language", choices=LANGUAGES)
    parser.add_argument("--worlds", type=int, default=WORLDS)
    given = parser.parse_args()
    models = read_models(given.model) if given.model else demo_models()
    compensator = Compensator.of(models, Limits(), watching=True)
    tables, good = gather(compensator), True
    languages = [given.language] if given.language else LANGUAGES
    if "c" in languages and shutil.which("gcc"):
        with tempfile.TemporaryDirectory() as folder:
            c = InC(compensator, tables, given.worlds, Path(folder))
            good &= measure("c", c.text, c.judge, given.mutants, given.seed)
    if "st" in languages:
        try:
            st = InStructuredText(compensator, tables, min(given.worlds, 2))
        except ModuleNotFoundError as error:
            print(f"no {error.name}: structured text left out")
        else:
            good &= measure("st", st.text, st.judge, given.mutants, given.seed)
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())

"""The planner: detection of gaps, benefit of its test compared with another one, and cost of stopping early.

Run with ``python benchmarks/bench_plan.py [--seeds 30 40] [--chen 21 22 23] [--jobs 2] [--figure PATH]``
(five minutes on two free cores).

First, recordings of the virtual machine with one gap each: no run above half of the top speed, no standstill after a
fast run, a constant room temperature, or no run or standstill longer than 30 min. The planner's first test must fill
the gap. With this test in the training data, the error of the frozen model on a varied recording (all speeds,
standstills and room temperatures) must be smaller than with a test of equal length drawn from the rest of the grid.

Then the stopping rule: in each test of `chen1996` the spindle is stopped as soon as the rule permits it, and the test
ended as soon as it permits it again. Models fitted to these tests are evaluated on the full tests, with each file left
out, and compared with models fitted to the full tests and to tests cut at fixed times.
"""

import argparse
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from thermocomp.judging.planning.planning import Candidate, make_grid, plan
from thermocomp.judging.planning.trial import Trial
from thermocomp.judging.replay import replay_compensated
from thermocomp.judging.settling.stopping import judge_running
from thermocomp.models.training import train
from thermocomp.recordings.cycles import make_single_cycle
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.stacking import stack
from thermocomp.virtual.datasets import record
from thermocomp.virtual.protocol import Physics

Gap = Literal["speed", "stop", "room", "duration"]
GAPS: tuple[Gap, ...] = get_args(Gap)
TARGETS = ("x1_um", "y1_um", "z_um")
TOP = 3000.0
#: required number of correct results of ten; limits of relative duration and error ratio of the stopping rule
RIGHT, SHARE, RATIO = 0.8, 1 / 3, 1.2
#: of chen1996: speeds [1/min], run and standstill [min], time between two rows [min]
SPEEDS, RUN, STOP, SAMPLING = (600, 1000, 1500, 2100, 2600), 360, 600, 6
#: run and standstill of tests that are cut at fixed times [min]
CUTS = ((90, 90), (120, 198), (156, 156), (198, 120), (180, 300), (240, 360), (300, 480))


def segment(minutes: float, speed: float = 0.0) -> str:
    return f'[[segments]]\nduration = "{round(minutes)} min"\nspeed = {10 * round(speed / 10)}\n'


def climate(daily: float, wander: float, begin: float) -> str:
    return f'climate = {{daily = {daily}, wander = {wander}, begin = "{begin:.2f} h"}}\n'


def with_gap(gap: Gap, rng: np.random.Generator) -> str:
    """Return a protocol of six speeds in which one condition is missing."""
    text = climate(0.0, 0.05, 8.0) if gap == "room" else climate(4.0, 0.6, rng.uniform(5, 11))
    text += segment(15)
    for share in rng.permutation(np.linspace(0.15, 0.5, 6) if gap == "speed" else np.linspace(0.2, 1.0, 6)):
        speed = TOP * float(share)
        if gap == "duration":
            for _ in range(5):
                text += segment(int(rng.integers(15, 31)), speed) + segment(int(rng.integers(15, 31)))
        elif gap == "stop" and share > 0.45:
            text += segment(int(rng.integers(90, 200)), speed) + segment(
                int(rng.integers(60, 160)), TOP * rng.uniform(0.2, 0.4)
            )
        else:
            text += segment(int(rng.integers(90, 200)), speed) + segment(int(rng.integers(60, 160)))
    return text


def varied(rng: np.random.Generator) -> str:
    """Return a protocol of all speeds, short and long runs and standstills, with a changing room temperature."""
    text = climate(4.0, 0.6, rng.uniform(4, 10)) + segment(15)
    for _ in range(4):
        for share in rng.permutation([0.2, 0.4, 0.6, 0.8, 1.0]):
            text += segment(rng.choice([30, 90, 240]), TOP * float(share)) + segment(rng.choice([20, 60, 180]))
    return text


def test_of(trial: Trial, gap: Gap) -> str:
    """Return the protocol of a test, in the climate of the recording unless the test changes the room temperature."""
    if trial.kind == "room":
        text = climate(5.0, 0.3, 4.0)
    else:
        text = climate(0.0, 0.05, 8.0) if gap == "room" else climate(4.0, 0.6, 8.0)
    return text + "".join(segment(duration / 60, speed) for speed, duration in trial.steps)


def fills(gap: Gap, trial: Trial) -> bool:
    """Return whether a test fills the gap."""
    return {
        "speed": trial.speed > 0.6 * TOP,
        "stop": trial.kind == "stop" and trial.speed > 0.45 * TOP,
        "room": trial.kind == "room",
        "duration": trial.kind in ("run", "stop"),
    }[gap]


def recorded(name: str, protocol: str, seed: int, physics: Physics) -> list[Recording]:
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"{name}.toml"
        path.write_text(f'sampling = "1 min"\nplaces = "usual"\n{protocol}', encoding="utf-8")
        return record(path, seed=seed, physics=physics)


def unseen(learned: Sequence[Recording], judged: Recording) -> NDArray[np.float64]:
    """Return the squared errors of frozen models on a recording, (n_rows, n_targets)."""
    samples = stack([*learned, judged], TARGETS)
    rows = samples.test == len(learned)
    left = []
    for k in range(len(TARGETS)):
        model = train("averaged", samples, k, ~rows, joint=False).model
        left.append(samples.deviations[rows, k] - replay_compensated(model, samples, rows).compensated)
    return np.array(left).T ** 2


def rms(squares: NDArray[np.float64]) -> float:
    return float(np.sqrt(squares.mean(axis=0)).mean())


class Filled(NamedTuple):
    """Result of the planner for one gap."""

    gap: Gap
    best: Candidate
    drawn: Candidate
    expected: float  #: error, by the planner [um]
    before: float  #: error on the varied recording [um]
    planned: float  #: with the planner's test [um]
    random: float  #: with the test that was drawn [um]


def fill(physics: Physics, seed: int) -> Filled:
    """Plan for one recording with a gap, and record the planner's test and another."""
    gap, rng = GAPS[seed % len(GAPS)], np.random.default_rng(seed)
    base = recorded("base", with_gap(gap, rng), seed, physics)
    found = plan(stack(base, TARGETS), TOP)
    judged = recorded("varied", varied(rng), seed + 1000, physics)[0]
    best, *others = found.candidates
    drawn = others[int(rng.integers(len(others)))]
    after = [
        rms(unseen([*base, *recorded(name, test_of(c.trial, gap), seed + 2000, physics)], judged))
        for name, c in (("planned", best), ("drawn", drawn))
    ]
    return Filled(gap, best, drawn, found.expected, rms(unseen(base, judged)), after[0], after[1])


def chen(lengths: Sequence[tuple[float, float]], seed: int) -> list[Recording]:
    """Record chen1996 with other durations of run and standstill [min]."""
    text = f'sampling = "{SAMPLING} min"\n'
    for speed, (run, stop) in zip(SPEEDS, lengths, strict=True):
        text += (
            f'[[tests]]\nname = "{speed}"\nsegments = [{{duration = "6 min"}}, {{duration = "{run:g} min", '
            f'speed = {speed}, feed = {{x = 600, y = 1000, z = 600}}}}, {{duration = "{stop:g} min"}}]\n'
        )
    with TemporaryDirectory() as folder:
        path = Path(folder) / "chen1996.toml"
        path.write_text(text, encoding="utf-8")
        return record(path, seed=seed)


def cut(recording: Recording, rows: int) -> Recording:
    """Return the first rows of a recording."""
    return replace(recording, time=recording.time[:rows], table=recording.table[:rows], cycles=make_single_cycle(rows))


def stopped_after(recording: Recording, first: int, last: int) -> int:
    """Return the minutes after which the rule ends the phase that begins in a row."""
    for row in range(first + 5, last):  # no result before that
        if judge_running(cut(recording, row + 1), TARGETS).may_stop:
            return SAMPLING * (row - first)
    return SAMPLING * (last - first)


def by_rule(seed: int) -> list[tuple[float, float]]:
    """Return the durations of run and standstill of each test, as ended by the rule [min]."""
    full = chen([(RUN, STOP)] * len(SPEEDS), seed)
    runs = [stopped_after(r, 1, 1 + RUN // SAMPLING) for r in full]
    again = chen([(run, STOP) for run in runs], seed)
    firsts = [1 + run // SAMPLING for run in runs]
    stops = [stopped_after(r, first, first + STOP // SAMPLING) for r, first in zip(again, firsts, strict=True)]
    return list(zip(runs, stops, strict=True))


class Stopped(NamedTuple):
    """Cost of shorter tests."""

    name: str
    share: float  #: of the time of the full tests
    ratio: float  #: of the unseen error to that of the full tests


def judged_on(learned: Sequence[Recording], full: Sequence[Recording]) -> float:
    """Return the error on the full tests, each left out of the training in turn [um]."""
    left = [unseen([r for j, r in enumerate(learned) if j != k], f) for k, f in enumerate(full)]
    return rms(np.concatenate(left))


def stop_early(seed: int) -> list[Stopped]:
    """Return the costs of ending the tests of one seed by the rule, and at fixed times."""
    full = chen([(RUN, STOP)] * len(SPEEDS), seed)
    none = judged_on(full, full)
    found = []
    ways: dict[str, Sequence[tuple[float, float]]] = {
        "rule": by_rule(seed),
        **{f"{run} + {stop} min": [(run, stop)] * len(SPEEDS) for run, stop in CUTS},
    }
    for name, lengths in ways.items():
        share = sum(run + stop for run, stop in lengths) / (len(SPEEDS) * (RUN + STOP))
        found.append(Stopped(name, share, judged_on(chen(lengths, seed), full) / none))
    return found


def draw(found: Sequence[Sequence[Stopped]], path: Path) -> None:
    """Plot the error over the duration of the tests."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    ax = figure.subplots()
    for k, one in enumerate(found):
        rule, *fixed = one
        fixed = [*sorted(fixed, key=lambda s: s.share), Stopped("full", 1.0, 1.0)]
        ax.plot([100 * s.share for s in fixed], [s.ratio for s in fixed], ".-", color="#1f77b4", alpha=0.6,
                label="" if k else "cut at fixed times")  # fmt: skip
        ax.plot(100 * rule.share, rule.ratio, "o", color="#d62728", label="" if k else "ended by the rule")
    ax.axhline(RATIO, color="#999999", ls="--", lw=0.8)
    ax.axvline(100 * SHARE, color="#999999", ls="--", lw=0.8)
    ax.set_xlabel("time of the tests [% of 5 x 16 h]")
    ax.set_ylabel("error on unseen data, relative to training with full tests")
    ax.set_ylim(bottom=0)
    ax.legend(frameon=False)
    figure.savefig(path, dpi=110)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs=2, default=(30, 40), help="first, and the one after the last")
    parser.add_argument("--chen", type=int, nargs="*", default=(21, 22, 23))
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--physics", choices=get_args(Physics), default="nonlinear")
    parser.add_argument("--figure", type=Path)
    options = parser.parse_args()
    with ProcessPoolExecutor(options.jobs) as pool:
        filled = []
        for seed, f in zip(
            range(*options.seeds), pool.map(partial(fill, options.physics), range(*options.seeds)), strict=True
        ):
            filled.append(f)
            print(
                f"seed {seed}, gap {f.gap}: next {f.best.trial.words} ({f.best.news or 'nothing new'})"
                f"{'' if fills(f.gap, f.best.trial) else ', NOT THE GAP'}; expected {f.expected:.2f}, minus "
                f"{f.best.gain:.2f}; unseen {f.before:.2f}, with it {f.planned:.2f}, with {f.drawn.trial.words} "
                f"{f.random:.2f} um",
                flush=True,
            )
        stopped = list(pool.map(stop_early, options.chen))
    n = len(filled)
    named, better = sum(fills(f.gap, f.best.trial) for f in filled), sum(f.planned < f.random for f in filled)
    grid = make_grid(TOP, 12.0)
    by_chance = np.mean([fills(f.gap, t) for f in filled for t in grid])
    always = max(sum(fills(f.gap, t) for f in filled) for t in grid)
    print(
        f"the gap is named first in {named} of {n} (a test drawn from the grid fills it in {100 * by_chance:.0f} %; "
        f"the one test that fills most gaps, always the same, in {always})"
    )
    print(f"the planner's test lowers the unseen error more than one at random in {better} of {n}")
    reached = named >= RIGHT * n and better >= RIGHT * n
    print(f"planning: {'reached' if reached else 'MISSED'}")
    for k, name in enumerate(s.name for s in stopped[0]) if stopped else ():
        mine = [one[k] for one in stopped]
        print(
            f"chen1996, {name}: {', '.join(f'{100 * s.share:.0f} %' for s in mine)} of the time, unseen error "
            f"{', '.join(f'{s.ratio:.2f}' for s in mine)} times that of full tests"
        )
    early = all(one[0].share <= SHARE and one[0].ratio <= RATIO for one in stopped)
    if stopped:
        print(f"stopping: {'reached' if early else 'MISSED'}")
    if options.figure and stopped:
        draw(stopped, options.figure)
    return 0 if reached and early else 1


if __name__ == "__main__":
    sys.exit(main())

"""Error with two sensors lost, or exchanged, with the watch (sensor monitoring) and without it.

Run with ``python benchmarks/bench_pairs.py [cycles]`` (all four). Each thermal cycle of fl_thermal (rows 0-6668, all
sensors and six) is left out of the training of `averaged` and of the watch. For every pair of temperatures, in this
cycle either both are dead from a random instant on, or they are exchanged at their terminals from the start on, each
relative to its own zero. Which models may continue without both is determined on the other cycles, as by ``fit``.

The error is the RMS from the failure on. Without a watch, readings with a dead sensor are rejected, and exchanged ones
used. Goals: with the watch at most 1.05 times the error without it, or 0.1 um more; a correction that goes on with a
substitute at most twice the error with all sensors intact, for 80 % of the dead pairs of all sensors and 40 % of six.
"""

import sys
from collections.abc import Iterator
from itertools import combinations
from typing import NamedTuple

import numpy as np

from bench_standin import TARGETS, cases, held, judge_losses, left
from thermocomp.core.arrays import FloatArray
from thermocomp.core.provenance import HonestError
from thermocomp.models.training import train
from thermocomp.models.watching import find_watch
from thermocomp.recordings.samples import Samples
from thermocomp.runtime.watch import look
from thermocomp.runtime.watchstate import GOOD, begin

#: goals: ratio to the error without a watch, or excess over it [um]; ratio to that with all sensors; share of pairs
RATIO, EXCESS, SOUND = 1.05, 0.1, 2.0
SHARES = {16: 0.8, 6: 0.4}


class Pair(NamedTuple):
    """Effect of a failure of two sensors on the error of one target."""

    target: str
    sensors: tuple[str, str]
    dead: bool  #: otherwise exchanged
    runs_on: bool  #: the correction goes on to the end, with substitutes or with readings
    error: float  #: with the watch [um]
    bare: float  #: without it [um]
    sound: float  #: with all sensors intact [um]


def pairs(samples: Samples, cycle: int) -> Iterator[Pair]:
    """Yield the effect of each pair, dead and exchanged, on each target in a cycle."""
    learn, honest = samples.cycle != cycle, judge_losses(samples, cycle)
    watch = find_watch(samples, learn)
    if watch is None:
        raise SystemExit("nothing to watch")
    names = [c.name for c in samples.inputs]
    columns = [names.index(i.name) for i in watch.inputs]
    rows = np.flatnonzero(samples.cycle == cycle)
    stop, rng = int(rows[-1]) + 1, np.random.default_rng(cycle)
    early = rows[: len(rows) // 2]
    two = list(combinations(range(len(watch.sensors)), 2))
    runs = [(pair, int(rng.choice(early)), True) for pair in two] + [(pair, 0, False) for pair in two]
    given = np.repeat(samples.values[:stop, None], 1 + len(runs), axis=1)
    zero = samples.reference()[int(samples.test[rows[0]])]
    for run, (pair, row, dead) in enumerate(runs, start=1):
        i, j = (columns[watch.sensors[p].input] for p in pair)
        if dead:
            given[row:, run, [i, j]] = np.nan
        else:
            given[:, run, [i, j]] = given[:, run, [j, i]] - zero[[j, i]] + zero[[i, j]]
    state, passed = begin(watch, runs=(1 + len(runs),)), given.copy()
    faults = np.zeros((stop, 1 + len(runs), len(watch.sensors)), dtype=np.bool_)
    for k in range(stop):
        state, let = look(watch, state, float(samples.time[k]), given[k][:, columns], resting=bool(samples.stands[k]))
        passed[k][:, columns] = let
        faults[k] = state.fault != GOOD
    for k, target in enumerate(TARGETS):
        model, errors = train("averaged", samples, k, learn).model, honest[target]
        well = left(model, samples, passed[:, 0], k)
        for run, (pair, row, dead) in enumerate(runs, start=1):
            mine = left(model, samples, passed[:, run], k)
            runs_on = np.array([_may(errors, watch.names, set(), len(watch.names))] * stop)
            sets, which = np.unique(faults[:, run], axis=0, return_inverse=True)
            for case, failed in enumerate(sets):
                lost = {n for n, f in zip(watch.names, failed, strict=True) if f and n in model.sensors}
                runs_on[which.ravel() == case] = _may(errors, model.sensors, lost, len(watch.names))
            if not runs_on.all():
                mine = held(samples, mine, k, int(np.flatnonzero(~runs_on)[0]))
            bare = left(model, samples, given[:, run], k)
            part = slice(max(row, int(rows[0])), stop)
            yield Pair(
                target=target,
                sensors=(watch.names[pair[0]], watch.names[pair[1]]),
                dead=dead,
                runs_on=bool(runs_on.all()),
                error=_rms(mine[part]),
                bare=_rms(bare[part]),
                sound=_rms(well[part]),
            )


def _may(errors: HonestError, names: tuple[str, ...], lost: set[str], watched: int) -> bool:
    return not lost or errors.may_lose([n for n in names if n in lost], watched // 4)


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values[np.isfinite(values)] ** 2)))


def show(title: str, found: list[Pair], sensors: int) -> bool:
    """Print the table; return whether the goals are reached."""
    reached = True
    print(f"{title}: {len(found)} runs")
    for dead in (True, False):
        for target in TARGETS:
            of = [p for p in found if p.dead is dead and p.target == target]
            worse = [p for p in of if p.error > max(RATIO * p.bare, p.bare + EXCESS)]
            good = sum(p.runs_on and p.error <= SOUND * p.sound for p in of) / len(of)
            worst = max(of, key=lambda p: p.error - p.bare)
            ok = not worse and (not dead or good >= SHARES[sensors])
            reached &= ok
            error, bare, sound = (np.median([getattr(p, name) for p in of]) for name in ("error", "bare", "sound"))
            print(
                f"  {target:<7} {'dead' if dead else 'exchanged':<10} median error {error:5.2f} um, without a watch "
                f"{bare:5.2f}, all intact {sound:5.2f}; goes on at up to twice: {100 * good:3.0f} %; worse than "
                f"without a watch: {len(worse)} of {len(of)}, worst {worst.error:.2f} for {worst.bare:.2f} "
                f"({', '.join(worst.sensors)}){'' if ok else ' MISSED'}"
            )
    return reached


def main() -> int:
    reached = True
    for title, samples in cases():
        cycles = np.unique(samples.cycle[samples.cycle >= 0]).tolist()[
            : int(sys.argv[1]) if len(sys.argv) > 1 else None
        ]
        sensors = sum(c.quantity == "temperature" for c in samples.inputs)
        reached &= show(title, [p for cycle in cycles for p in pairs(samples, cycle)], sensors)
    print(f"goal: {'reached' if reached else 'MISSED'}")
    return 0 if reached else 1


if __name__ == "__main__":
    sys.exit(main())

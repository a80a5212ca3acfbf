"""Both error rates of the verdict: models accepted though they prove nothing, and good models not accepted.

Run with ``python benchmarks/bench_verdict.py [--recordings 400] [--only WORDS] [--sets first,second,other]``. The sets
of generated recordings are in ``verdict_first.py``, ``verdict_second.py`` and ``verdict_other.py``. Each recording goes
through `compare`: the methods are fitted, replayed and evaluated as on the command line, except that the effects of
noise and of a lost sensor are not tested.

Printed are, for each kind of recording, the shares in which the recommendation, and in which any method, is *accepted*
and *accepted for this duty*; then the share that counts: any method, since an accepted one may run where the
recommendation is unproven; its exact 95 % interval, and the goal. Of the kinds in which the same drift occurs again and
again (`ONE_DUTY`), *accepted for this duty* is not false. Of the kinds with a good model (``true_...``) it is enough if
all cycles repeat one duty; for these kinds a table shows why the recommendation was not accepted. Of cold starts with a
good model only those recordings count whose best method (least error) does no harm in twenty fresh cycles of the same
machine. A recording in which repeated rows are found is rejected, and counts as not accepted.
Exit code 1 if a goal is missed.
"""

import argparse
import sys
import time
from collections import Counter
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from scipy import stats

import verdict_first
import verdict_other
import verdict_second
from thermocomp.core.exceptions import InputError
from thermocomp.core.machine import Channel
from thermocomp.core.provenance import Word, accepted
from thermocomp.core.size import Size
from thermocomp.judging import splits
from thermocomp.judging.baselines import BASELINES, OF_TIME
from thermocomp.judging.compare import compare
from thermocomp.judging.do_no_harm import LEVEL, Verdict
from thermocomp.judging.judgedunits import margin_of
from thermocomp.judging.replay import replay
from thermocomp.models.training import train
from thermocomp.recordings.cycles import Cycle
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack
from thermocomp.recordings.starts import COLD, Start
from verdict_case import Case, File, Make

SETS: dict[str, dict[str, Make]] = {
    "first": verdict_first.KINDS,
    "second": verdict_second.KINDS,
    "other": verdict_other.KINDS,
}
DUTY: Word = "accepted for this duty"
#: beginnings of the names of kinds whose mean curve is right: accepted for this duty is not false
ONE_DUTY = ("same_drift", "copies", "near_copies")
#: largest share of false acceptances of a kind, and of all kinds of a set together
FALSE, POOLED = 0.075, 0.05
#: the same for other kinds, by the beginning of their names
MOST = {"harmful": 0.05}
#: smallest share of good models accepted, by the beginning of the name of the kind
LEAST = {
    "true_six_duties_half": 0.8,
    "true_four_duties_fifth": 0.9,
    "true_repeats": 0.8,
    "true_collinear_six_half": 0.9,
    "true_collinear_four_fifth": 0.98,
}
#: reasons why a model was not accepted; for those not significantly better than a baseline, its short name
HARM, WORSE, OTHER, REJECTED = "harm", "worse", "other", "rejected"
SHORT = dict(zip((*BASELINES, *OF_TIME), ("none", "mean", "last", "curve", "slow"), strict=True))
WHY = (HARM, WORSE, *SHORT.values(), OTHER, DUTY, REJECTED)


class Outcome(NamedTuple):
    """Verdict on a recording."""

    null: bool
    duty: bool
    recommended: str  #: word of the recommendation
    any: str  #: most favourable word of the methods
    why: str  #: why the recommendation was not accepted, one of `WHY`; empty if it was
    good: bool  #: the best method does no harm in fresh cycles, or there are none


# -- a recording -------------------------------------------------------------------------------------------------------


def to_recording(name: str, file: File) -> Recording:
    table = pd.DataFrame(file.temperatures, columns=[f"t{k}_C" for k in range(file.temperatures.shape[1])])
    channels = [Channel(c, "temperature", "degC", "") for c in table.columns]
    if file.speed is not None:
        table["spindle_rpm"] = file.speed
        channels.append(Channel("spindle_rpm", "spindle_speed", "1/min", ""))
    table["z_um"] = file.drift
    channels.append(Channel("z_um", "displacement", "um", ""))
    cycles = tuple(Cycle(str(k), a, b) for k, (a, b) in enumerate(file.cycles, start=1))
    return Recording(name, file.time, table, tuple(channels), cycles, start=file.start)


def to_samples(case: Case) -> Samples:
    recordings = [to_recording(f"test {k}", f) for k, f in enumerate(case.files)]
    starts = [
        Start("continued", "cut", tuple(recordings[:k])) if f.continues else COLD for k, f in enumerate(case.files)
    ]
    return stack(recordings, ["z_um"], starts=starts)


def judged(make: Make, judging: Callable[[Samples], splits.Judging], methods: Sequence[str], seed: int) -> Outcome:
    case = make(np.random.default_rng(seed))
    try:
        samples = to_samples(case)
        found = compare(samples, methods, judging(samples), robustness=False, refit=False)
    except InputError as e:
        if "repeat rows" not in str(e):
            raise
        return Outcome(case.null, case.duty, REJECTED, REJECTED, REJECTED, good=True)
    best = max(found.overall(), key=lambda a: (a.word == "accepted", a.accepted))
    verdict = found.recommended[0].verdict if found.recommended else best.verdict
    good = not case.fresh or does_no_harm(samples, to_samples(Case(case.fresh, case.null)), methods)
    return Outcome(case.null, case.duty, verdict.word, best.word, reason(verdict, case.duty), good)


def does_no_harm(samples: Samples, fresh: Samples, methods: Sequence[str]) -> bool:
    """Return whether the method with the least error on fresh tests does no harm in any of them."""
    learned, every = np.ones(len(samples), dtype=np.bool_), np.ones(len(fresh), dtype=np.bool_)
    margin, y = margin_of(samples.learned(0, learned)), fresh.deviations[:, 0]
    errors = [y - replay(train(m, samples, 0, learned).model, fresh, every)[0] for m in methods]
    e = min(errors, key=lambda e: float(np.mean(e**2)))
    harm = [
        max(Size.of(e[own]).rms - Size.of(y[own]).rms, Size.of(e[own]).largest - Size.of(y[own]).largest)
        for own in (fresh.test == k for k in range(len(fresh.test_names)))
    ]
    return max(harm) <= margin


def reason(verdict: Verdict, duty: bool) -> str:
    """Return why a model was not accepted, one of `WHY`; empty if it was, or (`duty`) for the only duty there is."""
    if accepted(verdict.word):
        return DUTY if verdict.word == DUTY and not duty else ""
    if any(u.harmful for u in verdict.units):
        return HARM
    if verdict.refusal or verdict.caps or not verdict.units:
        return OTHER
    if verdict.mean_ratios[verdict.worst] >= 0:
        return WORSE
    return SHORT[verdict.worst] if verdict.p_value > LEVEL else OTHER


# -- all recordings ----------------------------------------------------------------------------------------------------


def begins(name: str, beginnings: Sequence[str]) -> bool:
    return name.startswith(tuple(beginnings))


def counted(name: str, found: Sequence[Outcome]) -> int:
    """Return the number of false acceptances, or of good models accepted."""
    both = not begins(name, ONE_DUTY) if found[0].null else found[0].duty
    words = ("accepted", DUTY) if both else ("accepted",)
    return sum(o.recommended in words or o.any in words for o in found)


def goal(name: str, null: bool) -> tuple[float, float]:
    """Return the range in which the counted share has to be."""
    goals = MOST if null else LEAST
    value = next((v for beginning, v in goals.items() if name.startswith(beginning)), FALSE if null else 0.0)
    return (0.0, value) if null else (value, 1.0)


def print_kind(name: str, found: Sequence[Outcome], took: float) -> bool:
    """Print the shares of a kind; return whether its goal is reached."""
    null, drawn, found = found[0].null, len(found), [o for o in found if o.good]
    n, k = max(len(found), 1), counted(name, found) if found else 0
    words = [o.recommended for o in found], [o.any for o in found]
    shares = [column.count(w) / n for column in words for w in ("accepted", DUTY)]
    low, high = stats.binomtest(k, n).proportion_ci(method="exact")
    least, most = goal(name, null)
    told = f"<= {most:.1%}" if most < 1 else f">= {least:.0%}" if least > 0 else ""
    ok = least <= k / n <= most
    rejected = sum(o.recommended == REJECTED for o in found)
    print(
        f"{name:39}{''.join(f'{s:7.1%}' for s in shares)} {k / n:8.1%} {f'{low:.1%}-{high:.1%}':>13}  {told:8}"
        f"{'' if ok else 'MISSED'}{f' {rejected} rejected' if rejected else ''}"
        f"{f' {len(found)} of {drawn} do no harm in fresh cycles' if len(found) < drawn else ''} {took:.0f} s",
        flush=True,
    )
    return ok


def print_reasons(truths: dict[str, list[Outcome]]) -> None:
    """Print why good models were not accepted."""
    names = ["duty" if w == DUTY else w for w in WHY]
    print(
        "\nwhy not accepted (worse: than a baseline on average; none to slow: not significantly better than it;"
        " duty: for this duty only)"
    )
    print(f"{'':39}{''.join(f'{w:>9}' for w in names)}")
    for name, found in truths.items():
        counts = Counter(o.why for o in found)
        print(f"{name:39}{''.join(f'{counts[w] / max(len(found), 1):9.1%}' for w in WHY)}")


def run_set(which: str, kinds: dict[str, Make], options: argparse.Namespace) -> list[str]:
    """Run and print the kinds of a set; return those whose goals are missed."""
    print(f"\n{which} set, {options.recordings} recordings of each kind")
    print(f"{'':39}{'recommended':>14}{'any method':>14}")
    print(f"{'':39}{'acc.':>7}{'duty':>7}{'acc.':>7}{'duty':>7} {'counts':>8} {'95 %':>13}  goal")
    methods, missed, pool = options.methods.split(","), list[str](), list[tuple[int, int]]()
    truths: dict[str, list[Outcome]] = {}
    for name, make in kinds.items():
        begin = time.perf_counter()
        judging = verdict_other.JUDGED.get(name, splits.leave_one_cycle_out)
        found = Parallel(n_jobs=options.jobs)(
            delayed(judged)(make, judging, methods, k) for k in range(options.recordings)
        )
        if not print_kind(name, found, time.perf_counter() - begin):
            missed.append(f"{which} {name}")
        if not found[0].null:
            truths[name] = [o for o in found if o.good]
        elif not begins(name, tuple(MOST)):
            pool.append((counted(name, found), len(found)))
    if pool:
        false, n = np.sum(pool, axis=0)
        ok = false / n <= POOLED
        told = f"{false / n:8.1%} {f'of {n}':>13}  {f'<= {POOLED:.1%}':8}"
        print(f"{'all kinds without a good model':67} {told}{'' if ok else 'MISSED'}")
        missed += [] if ok else [f"{which} pooled"]
    if truths:
        print_reasons(truths)
    return missed


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--recordings", type=int, default=400, help="recordings of each kind")
    parser.add_argument("--only", default="", help="kinds whose name contains one of these words: walk,daily")
    parser.add_argument("--sets", default=",".join(SETS))
    parser.add_argument("--methods", default="dynamic,averaged,ols")
    parser.add_argument("--jobs", type=int, default=-1)
    options = parser.parse_args()
    missed: list[str] = []
    for which in options.sets.split(","):
        kinds = {n: make for n, make in SETS[which].items() if any(word in n for word in options.only.split(","))}
        missed += run_set(which, kinds, options) if kinds else []
    if missed:
        print(f"\nmissed: {', '.join(missed)}")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())

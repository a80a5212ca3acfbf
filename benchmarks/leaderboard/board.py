"""Run models on tests, one after the other in a separate process, and write the results as a table."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from cases import CASES
from joblib.externals.loky import get_reusable_executor
from joblib.externals.loky.process_executor import TerminatedWorkerError
from published import Line
from work import attempt, ready

from thermocomp.core.exceptions import InputError
from thermocomp.judging.pieces import explain
from thermocomp.models.methods import METHODS

Found = dict[str, Any]


def models(folder: Path) -> dict[str, Path | None]:
    """Return the models: every method, and the files of the folder by their names."""
    files = sorted(p for p in folder.glob("*.py") if not p.name.startswith("_"))
    return {**dict.fromkeys(METHODS), **{(f"{p.stem} (file)" if p.stem in METHODS else p.stem): p for p in files}}


def run(entries: Mapping[str, Path | None], cases: Sequence[str], seconds: float) -> Iterator[tuple[str, str, Found]]:
    """Yield what each model leaves on each test.

    One that takes more than `seconds` of processor time (or ten times that, asleep), or kills its process, leaves
    nothing.
    """
    for name in METHODS.keys() & entries.keys():  # compilation of kernels is not timed
        _worker().submit(attempt, name, None, "hwang").result()
    for case in cases:
        for name, file in entries.items():
            try:
                yield name, case, _worker().submit(attempt, name, file, case, seconds).result(timeout=10 * seconds)
            except TimeoutError:
                _worker().shutdown(kill_workers=True)
                yield name, case, {"error": f"> {seconds:g} s", "late": True}
            except TerminatedWorkerError as e:
                late = "SIGPROF" in str(e)
                yield name, case, {"error": f"> {seconds:g} s", "late": True} if late else {"error": explain(e)}


def _worker() -> Any:
    """Return the worker process, with its imports done."""
    executor = get_reusable_executor(max_workers=1, timeout=None)
    executor.submit(ready).result()
    return executor


def rank(results: Mapping[str, Mapping[str, Found]]) -> list[str]:
    """Return the models with a result, the best first."""
    given = [name for name, of in results.items() if any("error" not in f for f in of.values())]
    return sorted(given, key=lambda name: (score(results[name]), name))


def score(of: Mapping[str, Found]) -> float:
    """Return the mean of the errors relative to no compensation; a test without a result counts as 1."""
    return float(sum(f.get("share_mae", 1.0) for f in of.values()) / len(of))


def add(board: Mapping[str, Any], found: Mapping[str, Any]) -> Found:
    """Return a board with the models of another run, each with the commit of that run.

    Raises
    ------
    InputError
        The runs differ in their tests or in the data of a test.
    """
    known, new = board["models"], {name: {**m, "commit": found["commit"]} for name, m in found["models"].items()}
    differing = [
        c for c in {**board["tests"], **found["tests"]} if _of(known, c, "none_mae") != _of(new, c, "none_mae")
    ]
    if differing:
        raise InputError(f"the board has other data for {', '.join(differing)}: run all models again")
    results = {name: m["tests"] for name, m in {**known, **new}.items()}
    return {**board, "ranking": rank(results), "models": {**known, **new}}


def table(board: Mapping[str, Any], log: Sequence[Line]) -> str:
    """Return the board as a page of Markdown."""
    results, tests = board["models"], board["tests"]
    cases = [c for c in tests if "skipped" not in tests[c]]
    stressed = [c for c in cases if CASES[c].stress]
    last = {line.name: line.mean for line in log if ", all " in line.model}
    head = ["model", "mean", *cases, *(f"{c}: noise, lost" for c in stressed), "inputs", "s", "published"]
    rows = [head, ["---", *["---:"] * (len(head) - 1)]]
    for name in board["ranking"]:
        of, figures = results[name]["tests"], [f for f in results[name]["tests"].values() if "error" not in f]
        low, high = min(f["sensors"][0] for f in figures), max(f["sensors"][1] for f in figures)
        rows.append(
            [
                name,
                f"{results[name]['score']:.1%}",
                *(_cell(of[c]) for c in cases),
                *(_stress(of[c]) for c in stressed),
                f"{low}" if low == high else f"{low}-{high}",
                f"{sum(f['processor_s'] for f in figures):.1f}",
                last.get(name, ""),
            ]
        )
    notes = {
        (name, f["error"]): [c for c, g in results[name]["tests"].items() if g.get("error") == f["error"]]
        for name in results
        for f in results[name]["tests"].values()
        if "error" in f
    }
    later = "".join(f" ({name}: {results[name]['commit']})" for name in results if "commit" in results[name])
    lines = [
        "# Leaderboard",
        "",
        f"{board['date']}, thermocomp {board['version']}, commit {board['commit']}{later}, {board['processor']}, one "
        f"thread, at most {board['limit']:g} s of processor time per model and test. Made by `python "
        "benchmarks/leaderboard`.",
        "",
        "Models alone, without gate and limits. Per test: mean over the channels of the mean absolute error in rows "
        "that were not used for training [um]; in brackets this error relative to that without compensation, and the "
        "largest such ratio of a channel. Sorted by `mean`: the mean of these ratios over all tests; a test without a "
        "result counts as no compensation, 100 %. `noise`: RMS relative to that without compensation with 0.4 degC of "
        "normal noise on every temperature, also on the readings of the zero; `lost`: the same in the worst channel "
        "with the most important input lost. `inputs`: number of inputs that the models use, including a spindle "
        "speed; `s`: processor time of all fits and replays. `published`: latest mean absolute error on the published "
        "test block of fl_thermal [um], from [the log](published_block.md), not included in `mean`. RMS, single "
        "channels and the time of the fits alone are in `board.json`.",
        "",
        *(f"| {' | '.join(row)} |" for row in rows),
        "",
        "| test | training data | validation data | rows | no compensation [um] |",
        "|---|---|---|---:|---:|",
        *(
            f"| {c} | {t['learned']} | {t['judged']} | "
            + (f"skipped: {t['skipped']} | |" if "skipped" in t else "")
            + ("" if "skipped" in t else f"{_of(results, c, 'rows')} | {_of(results, c, 'none_mae')} |")
            for c, t in tests.items()
        ),
        "",
        *(["No result:", ""] if notes else []),
        *(f"- {name}: {', '.join(of)}: {' '.join(why.split())}" for (name, why), of in notes.items()),
    ]
    return "\n".join(lines).rstrip() + "\n"


def _of(results: Mapping[str, Any], case: str, key: str) -> str:
    found = next((m["tests"][case][key] for m in results.values() if key in m["tests"].get(case, ())), "")
    return f"{found:.2f}" if isinstance(found, float) else f"{found}"


def _cell(found: Found) -> str:
    if "error" in found:
        return str(found["error"]) if found.get("late") else "-"
    return f"{found['mae']:.2f} ({found['share_mae']:.0%}, {found['worst']['share_mae']:.0%})"


def _stress(found: Found) -> str:
    return f"{found['noise_share_rms']:.0%}, {found['lost_share_rms']:.0%}" if "noise_share_rms" in found else "-"

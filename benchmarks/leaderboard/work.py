"""Evaluate one model on one test, in a worker process."""

import runpy
import signal
import time
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from cases import CASES, Made

from thermocomp.judging.compare import compare
from thermocomp.judging.pieces import explain
from thermocomp.models.foreign import adopt_estimator
from thermocomp.models.methods import METHODS, NamedEstimator


@cache
def _made(case: str) -> Made:
    return CASES[case].make()


def ready() -> None:
    """Do nothing: after this call the worker process has imported all modules."""


def load(name: str, file: Path | None) -> tuple[str, str]:
    """Return a model as `compare` takes it, and its summary."""
    if file is None:
        return name, METHODS[name].summary
    found = runpy.run_path(str(file))
    for wanted in ("SUMMARY", "estimator"):
        if wanted not in found:
            raise LookupError(f"{file.name} has no {wanted}: see README.md of the leaderboard")
    return NamedEstimator(name, adopt_estimator(found["estimator"]())), str(found["SUMMARY"])


def attempt(name: str, file: Path | None, case: str, seconds: float = 0.0) -> dict[str, Any]:
    """Return the result of `judge_model`, or the reason for its failure as ``error``.

    After more than `seconds` of processor time (0: never) the process is killed. Processor time is used because it does
    not depend on other programs.
    """
    if hasattr(signal, "setitimer"):  # elsewhere only the parent watches
        signal.setitimer(signal.ITIMER_PROF, seconds)
    begin = time.process_time()
    try:
        found = judge_model(name, file, case)
    except (Exception, SystemExit) as e:  # noqa: BLE001 - whatever a model raises, the others have their results
        found = {"error": explain(e)}
    finally:
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_PROF, 0.0)
    return {**found, "processor_s": time.process_time() - begin}


def judge_model(name: str, file: Path | None, case: str) -> dict[str, Any]:
    """Return the errors of a model on a test [um], also relative to those without compensation."""
    model, summary = load(name, file)
    samples, judging = _made(case)
    stress = CASES[case].stress
    # the models alone: gate and limits are the same for all, and would hide what one model does better than another
    whole = compare(samples, [model], judging, robustness=stress, refit=False, limits=None).overall()
    if why := next((a.failure for a in whole if a.failure), ""):
        return {"error": why, "summary": summary}
    found: dict[str, Any] = {"summary": summary, "channels": {}}
    for metric in ("mae", "rms"):
        left, none = ([f(metric) for f in fs] for fs in zip(*((a.metric, a.none_metric) for a in whole), strict=True))
        found[metric], found[f"none_{metric}"] = float(np.mean(left)), float(np.mean(none))
        found[f"share_{metric}"] = found[metric] / found[f"none_{metric}"]
        for a, mine, nothing in zip(whole, left, none, strict=True):
            found["channels"].setdefault(a.target, {}).update({metric: mine, f"share_{metric}": mine / nothing})
    worst = max(whole, key=lambda a: a.metric("mae") / a.none_metric("mae"))
    found["worst"] = {"channel": worst.target, "share_mae": found["channels"][worst.target]["share_mae"]}
    found["rows"] = len(samples)
    found["sensors"] = [min(a.n_sensors[0] for a in whole), max(a.n_sensors[1] for a in whole)]
    found["fit_s"] = sum(a.fit_s for a in whole)
    if all(a.robustness for a in whole):
        known = [a.robustness for a in whole if a.robustness]
        none_rms = np.mean([r.none_rms for r in known])
        found["noise_share_rms"] = float(np.mean([r.noise_rms["normal"][0] for r in known]) / none_rms)
        # the worst of all channels: the worst axis determines the accuracy of a machine
        lost = max(known, key=lambda r: r.worst_lost[1] / r.none_rms)
        found["lost_share_rms"] = lost.worst_lost[1] / lost.none_rms if lost.lost_rms else found["share_rms"]
        found["lost_sensor"] = lost.worst_lost[0]
    return found

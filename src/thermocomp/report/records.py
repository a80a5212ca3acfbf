"""Results as plain numbers and text: output of ``--json``, and source of the tables."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from itertools import pairwise
from statistics import median
from typing import Any

import numpy as np

from thermocomp.core.exceptions import Remedy
from thermocomp.core.machine import Channel
from thermocomp.core.messages import Message
from thermocomp.core.model import ErrorModel
from thermocomp.judging.inuse import WEIGHTS
from thermocomp.judging.results import Assessment, Comparison
from thermocomp.judging.splits import MIN_ROWS
from thermocomp.recordings.checks.findings import Finding
from thermocomp.recordings.cycles import Cycle
from thermocomp.recordings.recording import Recording
from thermocomp.report import declared
from thermocomp.report.layout import Column

#: more thermal cycles are summarised
MOST_CYCLES = 12
#: maximum number of values of a remedy shown
_FEW = 6
#: columns of a channel table: range of the values, and missing values
RANGE = (
    Column("smallest", "smallest", ".4g"),
    Column("largest", "largest", ".4g"),
    Column("missing", lambda c: c["missing"] or "", ">"),
)


def count_short(cycles: Sequence[Cycle]) -> int:
    """Return the number of thermal cycles that are too short to be judged alone."""
    return sum(len(c) < MIN_ROWS for c in cycles)


def describe_cycles(r: Recording) -> str:
    """Return the thermal cycles as text; of many only their sizes, and what becomes of the short ones."""
    if len(r.cycles) <= MOST_CYCLES:
        rows = ", ".join(f"{c.name}: rows {c.start}-{c.stop - 1}" for c in r.cycles)
        return f"{len(r.cycles)} thermal cycle(s): {rows}"
    sizes = [len(c) for c in r.cycles]
    usual = median(sizes)
    few = count_short(r.cycles)
    short = f"; {few} have fewer than {MIN_ROWS} rows and are judged with the one before" * bool(few)
    return (
        f"{len(sizes)} thermal cycles of {min(sizes)} to {max(sizes)} rows (median {usual:g} rows, "
        f"{usual * r.sampling_interval / 3600:.2g} h){short}. --json and the page list them all."
    )


def recording(r: Recording, found: Sequence[Finding]) -> dict[str, Any]:
    """Return a recording and its findings as plain numbers and text."""
    return {
        "name": r.name,
        "source": r.source,
        "rows": len(r),
        "hours": float(r.time[-1] - r.time[0]) / 3600,
        "sampling_interval_s": r.sampling_interval,
        "channels": [_channel(r, c) for c in r.channels],
        "cycles": [asdict(c) for c in r.cycles],
        "notes": list(r.notes),
        "worst": found[0].severity if found else None,
        "findings": [
            {
                "severity": f.severity,
                "kind": f.kind,
                "channel": f.channel,
                "text": f.text,
                "message": _message(f.text),
                "row": f.row,
                "rows": None if f.rows is None else stretches(f.rows),
                "remedy": None if f.remedy is None else dict(f.remedy),
            }
            for f in found
        ],
        **declared.recording(r),
    }


def _message(text: str) -> dict[str, Any] | None:
    """Return template and values of a message, messages among the values likewise; None of other text."""
    if not isinstance(text, Message):
        return None
    values = {k: _message(v) if isinstance(v, Message) else v for k, v in text.values.items()}
    return {"template": text.template, "values": values}


def remedy(content: Remedy) -> str:
    """Return a remedy as a line of text: the tables of a mapping and their keys."""
    parts = []
    for step in content.get("clean", ()):
        parts.append(f"[[clean]] {_keys(step)}")
    for name, said in content.get("columns", {}).items():
        parts.append(f"[columns.{name}] {_keys(said)}")
    parts += [f"[{key}] {_keys(said)}" for key, said in content.items() if key not in ("clean", "columns")]
    return "; ".join(parts)


def _keys(table: Remedy) -> str:
    """Return keys and values in TOML format; only the first of many values."""
    shown = {k: [*v[:_FEW], "..."] if isinstance(v, list) and len(v) > _FEW else v for k, v in table.items()}
    return ", ".join(f"{k} = {json.dumps(v, ensure_ascii=False)}" for k, v in shown.items())


def _channel(r: Recording, c: Channel) -> dict[str, Any]:
    values = r.table[c.name].to_numpy(dtype=np.float64)
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (None, None)
    return {**asdict(c), "smallest": low, "largest": high, "missing": len(values) - finite.size}


def stretches(rows: Sequence[int] | np.ndarray[Any, Any]) -> list[list[int]]:
    """Return runs of consecutive rows: first row, and the row after the last one."""
    ordered = np.unique(rows)
    cuts = [0, *(np.flatnonzero(np.diff(ordered) > 1) + 1).tolist(), len(ordered)]
    return [[int(ordered[a]), int(ordered[b - 1]) + 1] for a, b in pairwise(cuts)] if len(ordered) else []


def assessment(a: Assessment) -> dict[str, Any]:
    """Return the results of a model for a target, in one block or overall."""
    content: dict[str, Any] = {
        "model": a.model,
        "target": a.target,
        "block": a.block,
        "mae_um": a.metric("mae"),
        "rms_um": a.metric("rms"),
        "max_um": a.metric("max_abs"),
        "alone_mae_um": a.alone_metric("mae"),
        "alone_rms_um": a.alone_metric("rms"),
        "alone_max_um": a.alone_metric("max_abs"),
        "peak_to_peak_um": a.metric("peak_to_peak"),
        "none_mae_um": a.none_metric("mae"),
        "none_rms_um": a.none_metric("rms"),
        "none_peak_to_peak_um": a.none_metric("peak_to_peak"),
        "reduction_pct": a.metric("reduction"),
        "verdict": a.word,
        "reason": a.reason,
        "p_value": a.verdict.p_value if a.verdict.units else None,
        "tried": a.verdict.tried,
        "units": [
            {
                "name": u.name,
                "rms_um": u.rms,
                "none_rms_um": u.none_rms,
                "baselines_rms_um": {name: column[k].other for name, column in a.verdict.compared.items()},
                "agreement": {name: column[k].agreement for name, column in a.verdict.compared.items()},
                "margin_um": u.margin,
                "harmful": u.harmful,
            }
            for k, u in enumerate(a.verdict.units)
        ],
        "sensors": list(a.sensors),
        "n_sensors": a.n_sensors[1],
        "n_sensors_least": a.n_sensors[0],
        "fit_s": a.fit_s,
        "n_rows": len(a.measured),
        "n_rows_learned_from": a.learned,
        "n_effective": a.n_effective,
        "limits": a.limits and {k: v for k, v in asdict(a.limits).items() if k != "reading_age"},
        "readings_turned_away": a.rejected,
        "first_turned_away": a.turned_away,
        **(_band(a) | _probed(a) | declared.content(a)),
    }
    if a.robustness is not None:
        r = a.robustness
        content["robustness"] = {
            "noise_degC": r.noise,
            "noise_rms_um": {law: {"mean": mean, "max": top} for law, (mean, top) in r.noise_rms.items()},
            "lost_sensor_rms_um": r.lost_rms,
            "undetected_deviations": {n: {"deviation_degC": by, "rms_um": v} for n, (by, v) in r.deviating.items()},
            "worse_than_none": list(r.worse_than_none),
            "unlike_training_pct": 100 * r.unlike,
            "unlike_training_rms_um": r.unlike_rms,
            "outside_range_pct": 100 * r.outside,
            "outside_range_rms_um": r.outside_rms,
        }
    return content


def in_use(found: Comparison, a: Assessment) -> dict[str, Any]:
    """Return the error in use of a method, and what it is made of."""
    e = found.in_use(a)
    return {
        "rms_um": e.rms,
        "clean_rms_um": e.clean,
        "noise_rms_um": e.noisy,
        "lost_sensor_rms_um": e.lost,
        "weights": WEIGHTS,
        "noise_degC": found.noise,
        "noise_stated": found.stated,
    }


def _probed(a: Assessment) -> dict[str, Any]:
    """Return the residual with probings, without them, and with probings alone."""
    if a.probed is None:
        return {}
    errors = {"rms": "rms_um", "mae": "mae_um"}
    return {
        "probings": {
            "every_s": a.probed.plan.every,
            "repeatability_um": a.probed.plan.repeatability,
            "made": int(a.probed.at.sum()),
            "refused": list(a.probed.refused),
            "without": {key: a.unprobed_metric(name) for name, key in errors.items()},
            "alone": {key: a.held_metric(name) for name, key in errors.items()},
        }
    }


def _band(a: Assessment) -> dict[str, Any]:
    """Return the name of the band of a model, the fraction of judged rows inside it, and its mean half-width there."""
    return {"band": a.band or None, "coverage_pct": 100 * a.coverage, "half_width_um": a.half_width}


def model(m: ErrorModel, r_squared: float, overall: Assessment) -> dict[str, Any]:
    """Return a frozen model with its honest error, and the coverage of its band on the judged data."""
    honest = m.honest_error
    return {
        "target": m.target,
        "unit": m.unit,
        "family": m.family,
        "formula": m.formula(),
        "coefficients": m.coefficients_by_name(),
        "intercept": m.intercept,
        "r_squared": r_squared,
        "sensors": list(m.sensors),
        "unseen_rms_um": honest.rms if honest else None,
        "none_rms_um": honest.none_rms if honest else None,
        "verdict": honest.word if honest else None,
        "reason": honest.why if honest else None,
        **_band(overall),
        "band": m.band.words if m.band else None,
    }

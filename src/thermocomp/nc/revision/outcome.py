"""Results of the revision of an NC program: warnings and numbers."""

from collections.abc import Sequence
from typing import Any

from thermocomp.nc.interpreter.block import Setup
from thermocomp.nc.linuxcnc.verification.verify import Proof
from thermocomp.nc.revision import headers
from thermocomp.nc.revision.job import Done, Job
from thermocomp.nc.rewrite.offset import Offset
from thermocomp.nc.rewrite.revise import TELLING
from thermocomp.nc.thermal.inputs import SPEED


def warnings(job: Job, done: Done) -> list[str]:
    """Return warnings: reasons why the error of the tool may exceed its reported bound."""
    drift, revision = job.drift, job.revision
    found = list(drift.assumed)
    found += [
        f"{o.name} reached {o.farthest:g} {o.unit}, and a model was trained from {o.low:g} to {o.high:g} {o.unit}: "
        f"outside its range for {duration(o.seconds)}; since then the bound includes its whole prediction"
        for o in drift.outside
    ]
    found += [
        f"the forecast of {name} ends before the program: its last value was held for {duration(seconds)}"
        for name, seconds in drift.held.items()
    ]
    found += [
        f"{axis} was corrected at up to {far:.1f} mm beyond its outermost station: the value there was held"
        for axis, far in drift.beyond.items()
    ]
    found += [
        f"in the cuts the correction could not follow the drift at once because of {why}: {gap:.1f} um at line {line}"
        for why, (gap, line) in revision.held.items()
    ]
    found += [
        f"the model of {b.axis} may be wrong by {b.model:.1f} um, and the drift in the cuts is {b.without:.1f} um: "
        "revising may not help"
        for b in done.bounds
        if done.written and b.model > b.without > 0
    ]
    found += [] if job.travel is None else job.travel.warnings()
    if revision.standing:
        found.append(
            f"the spindle is stopped at line {revision.standing}, but the tool moves at feed rate: check the program"
        )
    if revision.idle:
        found.append(f"{revision.idle} lines after the end of the program are unchanged: they do not run")
    if done.written and revision.method.leaves_mark:
        found.append("G52 may stay in force if the run is aborted: send G52 X0 Y0 Z0 then")
    judged = [(s.axis, honest) for s in drift.stations if (honest := s.model.honest_error) is not None]
    found += [f"the model of {axis} is unproven: {honest.why}" for axis, honest in judged if honest.taken]
    found += [
        f"the model of {axis} was judged with a harm margin set by the user, {honest.harm_margin:g} um"
        for axis, honest in judged
        if honest.harm_margin is not None
    ]
    if all(i.quantity == SPEED for s in drift.stations for i in s.model.inputs):
        found.append(
            "the models use the spindle speed alone: a change of the room temperature is not part of the bounds"
        )
    if done.written and done.proof is None:
        found.append(f"no interpreter has verified it (--unproved){_assumed(revision.setup)}")
    if done.written and job.paths.picture is None:
        found.append("no picture was drawn: matplotlib is not installed (pip install 'thermocomp[study]')")
    return found


def describe_place(job: Job, done: Done) -> list[str]:
    """Return the origins and tools of a revision, if the drift depends on the position."""
    if not (done.written and job.drift.by_position):
        return []
    revision = job.revision
    cost = headers.cost(revision.elsewhere, job.drift.axes)
    return [f"the correction is made for {headers.describe_origins(revision)}; {cost}"]


def explain_nothing(job: Job, done: Done) -> str:
    """Return the reason why no correction was made, and what to do."""
    revision, most = job.revision, max((b.without for b in done.bounds), default=0.0)
    said = f"nothing was corrected: the drift in the cuts is {most:.1f} um at most"
    method, tolerance = revision.method, revision.demand.tolerance
    if most <= TELLING * tolerance:
        return f"{said}, and corrections start at {tolerance:g} um; run the original, or give a smaller --tolerance"
    if not isinstance(method, Offset):
        why = ", ".join(revision.held) or "the time between updates"
        return (
            f"{said}, and the correction was held because of {why}; change that in the program, or try --method "
            "offset with --safe-z"
        )
    if method.leaves_mark:
        return (
            f"{said}, but it was less than {tolerance:g} um wherever the offset could be updated; give "
            f"{'a' if method.safe_z is None else 'a lower'} --safe-z, so that there are more such points, or use "
            "--method coordinates"
        )
    if method.safe_z is None:
        return f"{said}, but there is no safe point: give --safe-z, or use --method coordinates"
    return (
        f"{said}, but no rapid in G90 begins at or above Z {method.safe_z:g} mm of the work coordinates after one: "
        "give a lower --safe-z, or use --method coordinates"
    )


def _assumed(setup: Setup) -> str:
    """Return the assumptions about the controller that were neither specified nor tested."""
    found = [
        text
        for text, missing in (
            ("no stored rotation (--rotation)", not setup.rotations),
            ("no G92 or G52 in force at the start (--no-g92)", not setup.no_shift),
            ("the codes that are in force at the start (--startup)", not setup.startup),
        )
        if missing
    ]
    found += [f"M{number} moves nothing (--harmless)" for number in sorted(setup.harmless)]
    return f"; assumed: {', '.join(found)}" if found else ""


def content(job: Job, done: Done, notes: Sequence[str]) -> dict[str, Any]:
    """Return all results, with units in the names."""
    revision, paths = job.revision, job.paths
    return {
        "program": str(job.program),
        "written": done.written,
        "nothing": None if done.written else explain_nothing(job, done),
        "files": {
            name: None if path is None or not done.written else str(path)
            for name, path in zip(paths._fields, paths, strict=True)
        },
        "lines": revision.lines,
        "changed": revision.changed,
        "run_time_s": revision.seconds,
        "spindle_1_per_min": [revision.slowest, revision.fastest],
        "tool_changes_s": revision.tool_changes,
        "models": list(job.models),
        "start": job.begun,
        "method": job.method,
        "axes": [
            {
                "axis": b.axis,
                "drift_low_um": b.low,
                "drift_high_um": b.high,
                "without_um": b.without,
                "left_um": b.left,
                "left_line": b.line,
                "model_um": b.model,
                "bound_um": b.most,
            }
            for b in done.bounds
        ],
        "conditions": [
            {
                "kind": c.kind,
                "taken": c.taken,
                "count": c.count,
                "others": [
                    {"taken": run.text, "left_um": dict(zip("xyz", run.left.most, strict=True))} for run in c.runs
                ],
                "adds_um": dict(zip("xyz", c.added(revision.left), strict=True)),
            }
            for c in revision.conditions.every
        ],
        "proof": None if done.proof is None else _proof(done.proof),
        "other_offset_um": dict(zip("xyz", revision.elsewhere.most, strict=True)) if job.drift.by_position else None,
        "warnings": warnings(job, done),
        "notes": [*notes, *describe_place(job, done)],
        "us_per_line": 1e6 * done.seconds / max(revision.lines, 1),
        "revising_s": done.seconds,
        "proving_s": done.proving,
    }


def _proof(proof: Proof) -> dict[str, Any]:
    return {
        "moves": proof.moves,
        "largest_um": proof.largest,
        "states": proof.states,
        "slower_percent": proof.slower,
        "held": list(proof.held),
        "drawn": list(proof.drawn),
        "sentence": proof.sentence,
    }


def duration(seconds: float) -> str:
    """Return a duration as text."""
    if seconds < 120:
        return f"{seconds:.3g} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 120 else f"{minutes // 60} h {minutes % 60:02d} min"

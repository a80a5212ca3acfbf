"""Instruction page of an exported compensator, for all languages: inputs, outputs, and their meaning."""

from collections.abc import Iterable

import numpy as np

from thermocomp.core.model import ErrorModel
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.program.tables import Tables

_POWER = """The temperatures of a warm machine must not become the zero. After a power-up, or a download,
`{of}status[k]` is 5 (reference unknown) and the corrections are 0, until one of these:

1. **A retained state continues**, if it is undamaged, of the same models, and the time without power is given: more
   than 0 and at most {day:g} h. The slow states of the models move on by this time, with the present inputs. After more
   than {hold:g} s without power the corrections take their new values at once, as no axis is referenced yet; otherwise,
   and without usable readings in the first {reading_age:g} s, they continue from the retained ones at their rate.
2. **The machine was off for more than {cold:.1f} h**: it is cold, and starts by itself.
3. **A signal says that it is cold**: a person's, or one that is TRUE on a cold machine only. The temperatures from
   then on become the zero, {wait}.
4. **A correction is re-zeroed**: with the deviation (actual minus commanded) that a probe measures, or with 0 if the
   datums were set anew on the machine as it is. It takes effect once the temperatures are averaged, {wait}. A speed
   whose heat the monitoring misses, since the machine is warm already, holds the correction again: best measure with
   the spindle stopped.

`{of}warm` says that the temperatures of the start look like those of a warm machine: a hint for the operator's
message, not reliable enough to decide."""

#: inputs named in the summary of a target
_MOST = 6


def explain(compensator: Compensator, tables: Tables, kept: str, cold: str, off: str) -> list[str]:
    """Return what a reader of the code must know, as paragraphs for the comment above it.

    Parameters
    ----------
    kept, cold, off : str
        How a state is retained, how a signal says that the machine is cold, and how the code is switched off.
    """
    limits, values = compensator.limits, tables.values
    held = f"held for {limits.hold:g} s, then decays to 0 with a time constant of {limits.fade:g} s"
    found = [
        "WHICH INPUTS COUNT MOST: change of the deviation, settled, when one input alone goes through its trained "
        f"range, the largest {_MOST}; the correction has the opposite sign"
    ]
    for target, line in compensator.lines.items():
        total: dict[str, float] = {}
        for k in range(line.models.start, line.models.stop):
            for name, change in _changes(compensator.models[k]).items():
                total[name] = total.get(name, 0.0) + values["to_offset"][k] * change
        most = sorted(total.items(), key=lambda item: -abs(item[1]))[:_MOST]
        found.append(f"{target}: {', '.join(f'{name} {change:+.3g} um' for name, change in most)}")
    if tables.sensors:
        needs: dict[str, list[str]] = {}
        for k, model in enumerate(compensator.models):
            pairs = zip(tables.sensors, values["leans_on"][k], values["may_lose"][k], strict=True)
            names = [name for name, leans, may_lose in pairs if leans and not may_lose]
            needs.setdefault(", ".join(names) or "none", []).append(model.target)
        needed = [f"{sensors} for {', '.join(targets)}" for sensors, targets in needs.items()]
        found.append(
            "A SENSOR THAT FAILS (fault above 0) is replaced by its prediction from the others. It is used again when "
            "it agrees with that, if it was missing (1) or unexplained (6); a temperature that was stepped (2), stuck "
            "(3) or swapped (5) must be repaired, and is used again after the next start from cold. A correction goes "
            "on if its model was judged to be better without the sensor than without compensation; otherwise it is "
            f"{held}. Sensors that must not be missing: {'; '.join(needed)}. Of several that are missing, the losses "
            "(effect) are added: beyond a number and a sum (most_lost, most_effect) the correction is held. A speed "
            "that is off (4) holds the corrections that depend on it. At a start no speed may be missing: rejected = "
            "2 until it is there."
        )
    else:
        found.append(
            "A SENSOR THAT FAILS: sensors are not monitored. With a missing or impossible value every correction is "
            f"{held}. A value that is wrong but possible is not noticed."
        )
    found += [
        "AT POWER-UP status is 5 and the correction 0, until one of these: a retained state continues "
        f"({kept}, at most {values['resumable'] / 3600.0:g} h without power; after more than {limits.hold:g} s the "
        "correction is taken at once, so call it before the axes are referenced); the machine was off, without such a "
        f"state, for more than {values['cold_after'] / 3600.0:.1f} h; a signal says that it is cold ({cold}); the "
        f"correction is re-zeroed by a measurement.{_zeroing(compensator, tables)}",
        "BEYOND THE TRAINED RANGE inputs count as at its end (input_low, input_high: the range and "
        f"{_listed(f'{100.0 * m.support.margin:g} %' for m in compensator.models)} of it on either side); outside "
        f"counts them. Then a model {_listed(_POLICIES[m.support.policy] for m in compensator.models)}. A "
        f"temperature far beyond (room) {'counts as missing' if tables.sensors else 'is not used: rejected = 2'}.",
        "CALL IT every ten seconds, or with each new reading. " + _each_call(compensator),
        f"TO SWITCH IT OFF: {off}; the correction is {held}. Do not write 0 in its place: the axis would jump. To "
        f"switch it on again: the true age; the correction moves to its value by at most {limits.rate:g} um/s. Limits "
        "are options of the export: export again to change them.",
    ]
    return found


def _zeroing(compensator: Compensator, tables: Tables) -> str:
    """Return what happens after a start from cold."""
    zeroing = compensator.models[0].zeroing
    if not tables.sizes["has_zero"]:
        return ""
    return (
        f" After a start from cold the temperatures are averaged for {zeroing.at_rest:g} s with the spindle stopped, "
        f"for {zeroing.otherwise:g} s otherwise; until then status is 0."
    )


def _each_call(compensator: Compensator) -> str:
    limits = compensator.limits
    return (
        "A call without a newer reading (its age has grown) is rejected (status 2 meanwhile), and a correction moves "
        f"by at most {limits.rate:g} um/s times the time since the previous call, of which {limits.reading_age:g} s "
        "count: many calls between two readings make it slow."
    )


def _changes(model: ErrorModel) -> dict[str, float]:
    """Return the change of a model's deviation, settled, when one input alone goes through its trained range [um]."""
    rest = np.array([i.reference for i in model.inputs])
    low, high = (np.diag([getattr(i, end) for i in model.inputs]) for end in ("low", "high"))
    _, said = model.step(model.init(rest), rest + np.concatenate((low, high)), 0.0)
    first, last = np.split(said, 2)
    return dict(zip((i.name for i in model.inputs), (last - first).tolist(), strict=True))


#: what a model does beyond its range
_POLICIES = {
    "clip": "goes on with these",
    "hold": "keeps its last value within the range",
    "fade": "fades to 0 with the distance",
}


def _listed(words: Iterable[str]) -> str:
    return " or ".join(dict.fromkeys(words))


def _geometry(tables: Tables, of: str) -> str:
    """Return how a correction is computed at a position."""
    ends = zip(*(tables.values[k] for k in ("travel_low", "travel_high")), strict=True)
    travels = ", ".join(f"{t} {a:g} to {b:g} mm" for t, (a, b) in zip(tables.targets, ends, strict=True) if a < b)
    return (
        "Only the thermal change of an axis error is corrected; its profile stays a table of the controller. The "
        f"correction\nat a position p [mm] is `{of}correction[k] + {of}slope[k] * (p - p0) / 1000` [um], with p0 from "
        f"the table, and p within the\nmeasured travel ({travels}): outside, use its end.\n\n"
    )


def describe(compensator: Compensator, tables: Tables, of: str = "") -> dict[str, object]:
    """Return the parts of the instruction page as text, by name."""
    slopes = any(tables.values["to_slope"])
    zeroing = compensator.models[0].zeroing
    sensors = (
        "\n\nThe temperature sensors are monitored: a sensor that is missing, stuck, stepped or swapped, or whose "
        "deviation from its prediction is unexplained, is replaced by its prediction from the others, if the model "
        "was judged without it; "
        f"otherwise the correction is held, then fades. `{of}fault[k]`, of {', '.join(tables.sensors)}: 0 good, 1 "
        "missing, 2 stepped, 3 stuck, 4 off, 5 swapped, 6 unexplained."
        if tables.sensors
        else "\n\nThe temperature sensors are not monitored: an implausible value stops the correction; a plausible "
        "but wrong value is not detected."
    )
    positions = zip(tables.targets, tables.values["position"], strict=True)
    return {
        "inputs": len(tables.channels),
        "values": "\n".join(f"| `value[{k}]` | {c.name} | {c.unit} |" for k, c in enumerate(tables.channels)),
        "line": "plus `slope[k]` [um/m] times the distance from" if slopes else "independent of position",
        "corrections": "\n".join(
            f"| `correction[{k}]` [um] | {t} | {f'{p:g} mm' if slopes else 'yes'} |"
            for k, (t, p) in enumerate(positions)
        ),
        "zero": f"Temperatures are relative to their mean over the first {zeroing.otherwise:g} s, or over "
        f"{zeroing.at_rest:g} s while the spindle is stopped; until then the correction does not change."
        if tables.sizes["has_zero"]
        else "No input is relative to the start.",
        "each_call": _each_call(compensator),
        "geometry": _geometry(tables, of) if slopes else "",
        "sign": "With the spindle stopped and a dial indicator on the axis, send +20 um to the controller instead of a "
        "correction:\nthe axis must move by 0.02 mm in its positive direction, and back with 0. If it moves the other "
        "way, reverse the sign\nwhere the correction is sent to the controller, nowhere else. Do not test with made-up "
        "temperatures: the sensor\nmonitoring rejects them.",
        "power": _POWER.format(
            of=of,
            hold=compensator.limits.hold,
            reading_age=compensator.limits.reading_age,
            day=float(tables.values["resumable"]) / 3600.0,
            cold=float(tables.values["cold_after"]) / 3600.0,
            wait=f"within {zeroing.at_rest:g} s" if tables.sizes["has_zero"] else "at once",
        ),
        "status": f"`{of}status[k]` is the state of a correction: 0 starts, 1 active, 2 holding, 3 fading, 4 shadow "
        f"(computed, not applied), 5\nits reference is unknown (see below). `{of}rejected` is the reason why a reading "
        "was not used: 0 it was used, 1 its time, 2 a\nmissing or implausible value, "
        "3 temperatures that do not fit the start of a machine, 4 the source "
        "has stopped: all temperatures\nrepeat, or the number of the reading does not change; the first number after a "
        "start is only noted. "
        f"`{of}outside` is the number of inputs beyond the trained range.",
        "sensors": sensors,
        "stopped": "A source that repeats its last values is found even if `age` is 0: each call with a valid age "
        "counts as a\nreading, and the temperatures repeat for much longer than usual. The number of the reading is "
        f"safer: if it has not\nchanged for {compensator.limits.reading_age:g} s, the values are too old; calls with "
        "the same number count as one reading.",
        "hold": compensator.limits.hold,
    }

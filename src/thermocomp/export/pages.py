"""Instruction page of an exported compensator, for all languages: inputs, outputs, and their meaning."""

from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.program.tables import Tables

_POWER = """The temperatures of a warm machine must not become the zero. After a power-up, or a download,
`{of}status[k]` is 5 (reference unknown) and the corrections are 0, until one of these:

1. **A retained state continues**, if it is undamaged, of the same models, and the time without power is given: more
   than 0 and at most {day:g} h. The slow states of the models move on by this time, with the present inputs. After more
   than {hold:g} s without power the corrections take their new values at once, as no axis is referenced yet; otherwise,
   and without usable readings in the first {reading_age:g} s, they continue from the retained ones at their rate.
2. **The machine was off for more than {cold:.1f} h**: it is cold, and starts by itself.
3. **It is told cold**: by a person, or by a signal that is TRUE on a cold machine only. The temperatures from then on
   become the zero, {wait}.
4. **A correction is re-zeroed**: with the deviation (actual minus commanded) that a probe measures, or with 0 if the
   datums were set anew on the machine as it is. It takes effect once the temperatures are averaged, {wait}. A speed
   whose heat the monitoring misses, since the machine is warm already, holds the correction again: best measure with
   the spindle stopped.

`{of}warm` says that the temperatures of the start look like those of a warm machine: a hint for the operator's
message, not reliable enough to decide."""


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
        "has stopped: all temperatures\nrepeat, or the number of the reading does not change. "
        f"`{of}outside` is the number of inputs beyond the trained range.",
        "sensors": sensors,
        "stopped": "A source that repeats its last values is found even if `age` is 0: each call with a valid age "
        "counts as a\nreading, and the temperatures repeat for much longer than usual. The number of the reading is "
        f"safer: if it has not\nchanged for {compensator.limits.reading_age:g} s, the values are too old; calls with "
        "the same number count as one reading.",
        "hold": compensator.limits.hold,
    }

"""Instruction page of an exported compensator, for all languages: inputs, outputs, and their meaning."""

from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.program.tables import Tables


def describe(compensator: Compensator, tables: Tables, of: str = "") -> dict[str, object]:
    """Return the parts of the instruction page as text, by name."""
    slopes = any(tables.values["to_slope"])
    zeroing = compensator.models[0].zeroing
    sensors = (
        "\n\nThe temperatures are watched: what is missing, stuck, off, stepped or swapped is replaced by what the "
        f"others say, if the model was judged without it; otherwise the correction holds and fades. `{of}fault[k]`, "
        f"of {', '.join(tables.sensors)}: 0 good, 1 missing, 2 stepped, 3 stuck, 4 off, 5 swapped."
        if tables.sensors
        else "\n\nThe temperatures are not watched: one that is not plausible stops the correction, a wrong one not."
    )
    positions = zip(tables.targets, tables.values["position"], strict=True)
    return {
        "inputs": len(tables.channels),
        "values": "\n".join(f"| `value[{k}]` | {c.name} | {c.unit} |" for k, c in enumerate(tables.channels)),
        "line": "add `slope[k]` [um/m] by the distance from" if slopes else "the same at every position",
        "corrections": "\n".join(
            f"| `correction[{k}]` [um] | {t} | {f'{p:g} mm' if slopes else 'yes'} |"
            for k, (t, p) in enumerate(positions)
        ),
        "zero": f"Temperatures count from the mean over the first {zeroing.otherwise:g} s, or over "
        f"{zeroing.at_rest:g} s while the spindle is stopped; until then the correction stays where it is."
        if tables.sizes["has_zero"]
        else "Nothing counts from the start.",
        "geometry": "Only what temperature changes along an axis is corrected: its profile stays a table of the "
        "controller.\n\n"
        if slopes
        else "",
        "sign": "Give the controller +20 um by hand in place of a correction, the spindle standing and an indicator on "
        "the\naxis: it has to move by 0.02 mm in its positive direction, and back with 0. If it goes the other way, "
        "turn the sign\nround where you hand the correction over, nowhere else. Temperatures that are made up are no "
        "trial: the watch does not\nbelieve them.",
        "status": f"`{of}status[k]` says how a correction is: 0 starts, 1 active, 2 holding, 3 fading, 4 shadow; "
        f"`{of}rejected`\nwhy a reading was not used: 0 it was, 1 its time, 2 a value missing or not plausible, 3 no "
        f"start of a machine;\n`{of}outside` how many inputs are beyond the trained range.",
        "sensors": sensors,
        "hold": compensator.limits.hold,
    }

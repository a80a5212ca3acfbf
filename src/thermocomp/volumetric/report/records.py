"""Results of position-dependent errors as plain numbers and text."""

from collections.abc import Sequence
from typing import Any

from thermocomp.volumetric.judging.position import PositionStudy
from thermocomp.volumetric.judging.positionerrors import CycleErrors
from thermocomp.volumetric.models.positionoptions import Setting


def position(found: PositionStudy, left_open: Sequence[Setting]) -> dict[str, Any]:
    """Return all results of one component as plain numbers, including the values chosen for open settings."""
    fit, judged = found.fit, found.assessment
    model = fit.model
    factors = []
    for power, factor, errors in zip(model.powers, model.models, fit.coefficient_errors, strict=True):
        honest = factor.honest_error
        factors.append(
            {
                "power": power,
                "unit": factor.unit,
                "formula": factor.formula(),
                "coefficients": factor.coefficients_by_name(),
                "standard_errors": errors,
                "intercept": factor.intercept,
                "sensors": factor.sensors,
                "unseen_rms": honest.rms if honest else None,
                "none_rms": honest.none_rms if honest else None,
            }
        )
    return {
        "target": model.target,
        "unit": model.unit,
        "axis": model.axis,
        "travel_mm": model.travel,
        "reference_position_mm": model.reference_position,
        "chosen_by_profiles": list(left_open),
        "profile": {
            "kind": model.profile.kind if model.profile else None,
            "order": fit.profile.order,
            "tried": [{"order": t.order, "terms": t.n_terms, "left_out": t.left_out} for t in fit.profile.tried],
        },
        "factors": factors,
        "thermal_rms": fit.thermal_rms,
        "remainders": {str(m): r for m, r in fit.remainders.items()},
        "enough": fit.enough,
        "offset_remainder": fit.offset_remainder,
        "shifts": fit.shifts,
        "judging": judged.protocol,
        "cycles": [cycle(c) for c in judged.cycles],
        "overall": cycle(judged.overall),
        "verdict": judged.verdict.word,
        "reason": judged.reason,
        "thermal_part_left_out": found.dropped or None,
    }


def cycle(c: CycleErrors) -> dict[str, Any]:
    """Return the errors of the unseen profiles of a cycle as plain numbers."""
    return {
        "cycle": c.cycle,
        "profiles": c.n_states,
        "none_rms": c.none,
        "cold_profile_rms": c.geometric,
        "rms": c.model,
        "none_max": c.none_max,
        "max": c.model_max,
    }

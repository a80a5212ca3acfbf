"""What a run keeps for its page beside the results of the commands: curves, sensor sets, and a live configuration."""

import json
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict
from typing import Any

import tomlkit

from thermocomp.api.results import Compared
from thermocomp.api.select import Selected
from thermocomp.cli.jsonoutput import as_text
from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import InputError
from thermocomp.core.model import ErrorModel
from thermocomp.core.plugins import find_plugins
from thermocomp.export.reduction.reduced import find_axis
from thermocomp.export.target import find_target
from thermocomp.judging.budget import Budget
from thermocomp.report import curves
from thermocomp.report.language import translate

#: maximum number of points of each curve
POINTS = 800

_LIVE = """\
# Live compensation with the models of this run; lines marked EDIT depend on the machine.
# To check it: thermocomp serve live.toml --check
models = ["model.json"]
state = "state.json"
shadow = true                        # EDIT: nothing is corrected until this line is removed
own_compensation = "unknown"         # EDIT: thermal compensation of the controller: "off" or "on"
first_start = "order"                # corrections begin with the order "start" on the page

# the recordings have a row every {interval:.0f} s; reading_age must be longer than the interval of the source
{limits}[[sources]]
kind = "mqtt"
topic = "machine/temperatures"       # EDIT: messages with {channels}
# host = "localhost"                 # EDIT: the broker
# names = {{ motor = {first} }}      # EDIT: if the names in the messages differ

[[sinks]]
kind = "mqtt"
topic = "machine/corrections"        # EDIT
confirm_topic = "machine/in_force"   # EDIT: topic on which the controller reports the correction in force

[page]
port = 8731
# token_file = "token.txt"           # EDIT: needed for orders; from: openssl rand -hex 16 > token.txt
"""


def curves_of(found: Compared) -> str:
    """Return the curves of every method on unseen data as JSON: measured, predicted, residual, band."""
    shown = [a for a in found.comparison.overall() if not a.failure]
    drawn = [
        {"target": a.target, "model": str(a.model), "panels": curves.run(a, found.recordings, POINTS)} for a in shown
    ]
    return as_text({"curves": drawn})


def points_of(found: Selected) -> str:
    """Return the error on unseen data against the sensors as JSON; methods that compute no errors have no points."""
    drawn: list[dict[str, Any]] = []
    for c in found.choices:
        budget = c.details if isinstance(c.details, Budget) else None
        points = [] if budget is None else _points(budget)
        unit = "" if budget is None else budget.unit
        drawn.append(
            {"target": c.target, "chosen": c.sensors, "why": translate(c.reason), "unit": unit, "points": points}
        )
    return as_text({"choices": drawn})


def _points(found: Budget) -> list[dict[str, Any]]:
    return [
        {"model": model, "sensors": sensors, "error": error}
        for model, errors in zip(found.models, found.mean().tolist(), strict=True)
        for sensors, error in zip(found.sensors, errors, strict=True)
    ]


def words_of(found: Compared) -> str:
    """Return what the page needs beside the results, as JSON.

    The translation of the reasons of verdicts by their English text, the axes in the names of the targets, and the
    controllers whose export needs axes.
    """
    reasons = {a.reason for a in found.comparison.overall()}
    axes = {a.target: find_axis(a.target, {}) for a in found.comparison.overall()}
    words = {str(r): str(translate(r)) for r in sorted(reasons)}
    return as_text({"words": words, "axes": axes, "driven": [*_driven()]})


def live_configuration(models: Sequence[ErrorModel], limits: Limits, interval: float) -> str:
    """Return a configuration of ``thermocomp serve`` for fitted models; what depends on the machine is marked.

    Parameters
    ----------
    interval : float
        Interval between the rows of the recordings [s].
    """
    used = list(dict.fromkeys(name for m in models for name in m.sensors)) or ["t1_C"]
    table = f"{tomlkit.dumps({'limits': asdict(limits)})}\n"
    channels = ", ".join(json.dumps(name) for name in used)
    return _LIVE.format(interval=interval, limits=table, channels=channels, first=json.dumps(used[0]))


def _driven() -> Iterator[str]:
    """Yield the export targets that need the axes of the models."""
    for name in find_plugins("exporters"):
        with suppress(InputError):  # a plug-in that cannot be loaded
            if (target := find_target(name)).axes or target.shape:
                yield name

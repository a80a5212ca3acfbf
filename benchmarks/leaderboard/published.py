"""The published test block of fl_thermal: few evaluations, recorded in a log, so that it remains unseen."""

import re
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

from cases import FL_THERMAL, displacements
from work import load

from thermocomp.core.exceptions import InputError
from thermocomp.core.zero import FIRST_READING
from thermocomp.files.draft import write_text
from thermocomp.judging import splits
from thermocomp.judging.compare import compare
from thermocomp.recordings.readers import recordings
from thermocomp.recordings.stacking import stack

#: maximum number of evaluations per model
MOST = 3


class Line(NamedTuple):
    """A line of the log: date, commit, model and its temperatures, five MAE and their mean [um]."""

    date: str
    commit: str
    model: str
    errors: str
    mean: str

    @property
    def name(self) -> str:
        """Of the model."""
        return self.model.partition(",")[0]


def read_log(path: Path) -> list[Line]:
    text = path.read_text(encoding="utf-8") if path.is_file() else ""
    rows = [[cell.strip() for cell in row.split("|")] for row in text.splitlines() if re.match(r"\d{4}-", row)]
    wrong = next((row for row in rows if len(row) != len(Line._fields)), None)
    if wrong:
        raise InputError(f"{path}: {' | '.join(wrong)!r} has {len(wrong)} columns instead of {len(Line._fields)}")
    return [Line(*row) for row in rows]


def evaluate(name: str, file: Path | None, log: Path, commit: str) -> Line:
    """Evaluate a model with all temperatures on the published block, as in the published study; append the line."""
    before = {(line.date, line.commit) for line in read_log(log) if line.name == name}
    if len(before) >= MOST:
        raise InputError(
            f"{name} was evaluated on the published block {len(before)} times ({log}); the maximum is {MOST}"
        )
    if not FL_THERMAL.is_file():
        raise InputError(f"{FL_THERMAL} is missing; set THERMOCOMP_DATA to the folder of the measured data")
    model, _ = load(name, file)
    found = [recordings.read(FL_THERMAL)]
    samples = stack(found, displacements(found), zeroing=FIRST_READING)  # as in the published study
    result = compare(samples, [model], splits.parse("0.75/0.25", samples), robustness=False).overall()
    if why := next((a.failure for a in result if a.failure), ""):
        raise InputError(f"{name} gives no result for the published block: {why}")
    errors = [a.metric("mae") for a in result]
    line = Line(
        datetime.now(UTC).date().isoformat(),
        commit,
        f"{name}, all {sum(c.quantity == 'temperature' for c in samples.inputs)}",
        " ".join(f"{e:.2f}" for e in errors),
        f"{sum(errors) / len(errors):.2f}",
    )
    write_text(log.read_text(encoding="utf-8") + " | ".join(line) + "\n", log, overwrite=True)
    return line

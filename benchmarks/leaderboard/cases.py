"""The tests on which the models are evaluated: one line per test."""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from thermocomp.judging.splits import Judging, Split, by_rows, leave_one_cycle_out, leave_one_file_out
from thermocomp.recordings.readers import recordings
from thermocomp.recordings.readers.mapping import read_mapping
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack
from thermocomp.virtual.datasets import record
from thermocomp.virtual.protocol import Physics

ROOT = Path(__file__).resolve().parents[2]
DATA = Path(os.environ.get("THERMOCOMP_DATA", ROOT.parent / "shared" / "data"))
FL_THERMAL = DATA / "fl_thermal" / "recording.csv"
VORON = DATA / "voron_frame" / "frame_exp_quant_v3_2021-06-13_05-41-53.csv"
#: first row of the published test block of fl_thermal; only `published.py` goes there
PUBLISHED = 6669

Made = tuple[Samples, Judging]


def displacements(found: Sequence[Recording]) -> list[str]:
    return [c.name for c in found[0].channels if c.quantity == "displacement"]


def virtual(experiment: str, leave_out: Callable[[Samples], Judging], every: int = 1, **how: Any) -> Made:
    """Record an experiment of which whole cycles or files are left out in turn; `how` is passed to `record`."""
    found = record(experiment, **how)
    samples = thin(stack(found, displacements(found)), every)
    return samples, leave_out(samples)


def thin(samples: Samples, every: int) -> Samples:
    """Return every n-th row, so that slow models finish, too."""
    return samples.take(np.arange(len(samples)) % every == 0)


def from_to(learn: str, judge: str, seed: int = 0, **how: Any) -> Made:
    """Train on all files of one experiment, validate on those of another, recorded with `seed`."""
    known, unseen = record(learn, **how), record(judge, seed=seed, **how)
    samples = stack([*known, *unseen], displacements(known))
    first = len(known)
    blocks = [
        Split(f"file {samples.test_names[k]}", samples.test < first, samples.test == k, whole=True)
        for k in range(first, len(samples.test_names))
    ]
    return samples, Judging(f"{learn} for training, {judge} unseen", tuple(blocks))


def fl_thermal_cycles() -> Made:
    found = [recordings.read(FL_THERMAL)]
    whole = stack(found, displacements(found))
    samples = thin(whole.take(np.arange(len(whole)) < PUBLISHED), 8)
    return samples, leave_one_cycle_out(samples)


def voron_cooling() -> Made:
    found = [recordings.read(VORON, read_mapping(ROOT / "docs" / "files" / "voron.toml"))]
    samples = stack(found, displacements(found))
    return samples, by_rows(samples, 0.5, 0.5)


@dataclass(frozen=True)
class Case:
    """A test.

    Parameters
    ----------
    name : str
    learned, judged : str
        Training and validation data, in words.
    make : callable
    stress : bool
        Whether to test also with noise and with each sensor lost.
    needs : Path, optional
        File required; the test is skipped if it is missing.
    """

    name: str
    learned: str
    judged: str
    make: Callable[[], Made]
    stress: bool = False
    needs: Path | None = None

    @property
    def absent(self) -> str:
        """Reason why the test is skipped; empty if it is not."""
        here = self.needs is None or self.needs.is_file()
        return "" if here else f"{self.needs} is missing; set THERMOCOMP_DATA to the folder of the measured data"


def on_virtual(physics: Physics) -> tuple[Case, ...]:
    """Return the tests on one of the two virtual machines."""
    own = "" if physics == "linear" else f"-{physics}"
    return (
        Case(
            f"demo{own}",
            "five of six cycles, each at another speed, with a changing room temperature, a row every 3 min",
            "the sixth cycle, each in turn",
            partial(virtual, "demo", leave_one_cycle_out, every=9, physics=physics),
        ),
        Case(
            f"chen1996{own}",
            "four of five speeds, 16 h each, starting cold",
            "the fifth speed, each in turn",
            partial(virtual, "chen1996", leave_one_file_out, physics=physics),
            stress=True,
        ),
        Case(
            f"random{own}",
            f"all of chen1996{own}: five constant speeds",
            "12 h of short jobs at random speeds",
            partial(from_to, "chen1996", "random", physics=physics),
        ),
        Case(
            f"hwang{own}",
            "37 rows: standstill, low and high speed in random order, axes moving",
            "the same in another order on another day",
            partial(from_to, "hwang", "hwang", seed=1, physics=physics),
        ),
        Case(
            f"stepwise2017{own}",
            "one day of four cycles, with much motion of X",
            "another day with other speeds and standstills",
            partial(from_to, "stepwise2017", "stepwise2017-online", physics=physics),
            stress=True,
        ),
    )


CASES = {
    c.name: c
    for c in (
        Case(
            "fl-thermal",
            "measured: a spindle, rows 0-6668, every eighth, three of the four thermal cycles",
            "the fourth cycle, each in turn (the last one without its end, which is in the published block)",
            fl_thermal_cycles,
            needs=FL_THERMAL,
        ),
        Case(
            "voron",
            "measured: frame of a printer, 3.3 h of heating",
            "3.3 h of cooling; no spindle speed",
            voron_cooling,
            needs=VORON,
        ),
        *on_virtual("linear"),
        *on_virtual("nonlinear"),
    )
}

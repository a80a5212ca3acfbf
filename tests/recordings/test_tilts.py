"""Tilts of the test bar from two probes, with the signs of the nest: A = (y1 - y2) / L, B = (x2 - x1) / L."""

import numpy as np
import pandas as pd
import pytest

from thermocomp.core.exceptions import InputError
from thermocomp.core.machine import Channel
from thermocomp.recordings.cycles import make_single_cycle
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.tilts import with_tilts

TABLE = {"y1_um": [0.0, 5.0], "y2_um": [0.0, 2.0], "x1_um": [0.0, -1.0], "x2_um": [0.0, 1.0], "t": [20.0, 30.0]}
TEST = Recording(
    "nest",
    np.array([0.0, 60.0]),
    pd.DataFrame(TABLE),
    (*(Channel(n, "displacement", "um") for n in list(TABLE)[:4]), Channel("t", "temperature", "degC")),
    make_single_cycle(2),
)


def test_two_probes_tell_the_tilt() -> None:
    (made,), names = with_tilts([TEST], ["A0C=y1_um:y2_um:100mm", "B0C=x1_um:x2_um:0.2 m"])
    assert names == ["A0C", "B0C"]
    assert made.table["A0C"].tolist() == pytest.approx([0.0, 30.0])
    assert made.table["B0C"].tolist() == pytest.approx([0.0, 10.0])
    assert [(c.quantity, c.unit) for c in made.channels[-2:]] == [("angle", "urad")] * 2
    assert "A0C" not in TEST.table


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("y1_um:y2_um:100mm", "write name, probe at the tip"),
        ("A0C=y1_um:y2_um", "write name, probe at the tip"),
        ("A0C=y1_um:y2_um:100", "write name, probe at the tip"),
        ("C0C=y1_um:y2_um:100mm", "begins with A"),
        ("A0C=y1_um:y2_um:-5mm", "must be positive"),
        ("A0C=y1_um:y3_um:100mm", "no channel is named 'y3_um'"),
        ("A0C=y1_um:t:100mm", "t is a temperature"),
    ],
)
def test_a_tilt_is_written_so_or_refused(text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        with_tilts([TEST], [text])


def test_a_name_is_taken_once() -> None:
    with pytest.raises(InputError, match="already"):
        with_tilts([TEST], ["A0C=y1_um:y2_um:100mm"] * 2)

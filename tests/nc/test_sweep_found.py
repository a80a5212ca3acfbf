"""Programs that the sweep of random ones has found to be revised wrongly, in as few lines as show it."""

from pathlib import Path

import pytest
from sweeping import WAYS, outcome

pytestmark = pytest.mark.usefixtures("interpreter")

FOUND = {
    "holes end at their first level": "G0 X0 Y0 Z20\nG99 G81 X10 Z-12 R1 F100\nG98 X20\nG80\nG4 P20\nG0 Z30",
    "a rotary axis alone goes home": "G0 X10 Y0 Z20 A90\nG4 P20\nG28 A0\nG4 P20\nG0 X30\nG0 X30 Y5 Z10",
    "a rotary axis at home goes home": "G0 X10 Y0 Z20 A0\nG4 P20\nG28 A0\nG4 P20\nG0 X30\nG10 L20 P0 Z0\nG0 Z9",
    "a rapid turns only, behind a stop": "G0 X0 Y0 Z20\nG91 A-45\nG90\nG4 P20\nM1\nG0 Z20 A-45\nG4 P9\nG0 X5",
    "a level comes to be R behind a stop": (
        "G0 X0 Y0 Z2\nG4 P20\n/M0\nG98 G81 X10 Z-3 R5 F400\nG4 P9\nG81 X20 Z-8 R2\nX30\nG80\nG0 Z20"
    ),
    "in inches G98 follows G99 at the same R": (
        "G20\nG0X-.27Y-1.1Z.3937\nG4P4\nG99G81X.12Y-1.1Z-.33465R.07874F13.\nG98G81X.5Z-.33465R.07874\nG80"
    ),
    "the first hole is where the tool stands": ("G0 X0 Y0 Z20\nG4 P20\nG98 G81 X0 Y0 Z-8 R3 F500\nX20\nG80\nG0 Z20"),
}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", FOUND)
def test_it_is_revised_rightly(name: str, way: str, tmp_path: Path) -> None:
    found = outcome(1, f"S3000 M3\n{FOUND[name]}\nM2\n", way, "Z", tmp_path, proof=True)
    if way == "offset" and "L20" in FOUND[name]:
        assert "names a place" in found.reasons[0]
    else:
        assert (found.kind, found.reasons) == ("revised", ())


def test_one_peck_more_or_less_is_refused_where_the_tool_stands_at_r(tmp_path: Path) -> None:
    text = "S3000 M3\nG0 X0 Y0 Z20\nG4 P1\nG99 G73 X10 Z-3 R1 Q2.5 F170\nX20 Z-4\nG80\nM2\n"
    found = outcome(1, text, "coordinates", "Z", tmp_path, proof=True)
    assert found.kind == "refused"
    assert "line 5: Q divides the distance from R to Z" in found.reasons[0]
    found = outcome(
        1, text.replace("X20", "G80\nG0 Z20\nG99 G73 X20 R1 Q2.5"), "coordinates", "Z", tmp_path, proof=True
    )
    assert (found.kind, found.reasons) == ("revised", ())

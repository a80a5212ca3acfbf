"""Thermal tests after ISO 230-3, positioning after ISO 230-2 and time constants, in Python."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import InputError, UnitError
from thermocomp.core.model import ErrorModel
from thermocomp.core.units import read_with_unit
from thermocomp.iso230 import part2, part3, tables
from thermocomp.iso230.part2 import PositioningResult
from thermocomp.iso230.thermaltest import Pair, ThermalTest
from thermocomp.judging.settling.settling import Phase, Settling, find_phases, time_constants
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.starts import Start
from thermocomp.volumetric.files import positioning as positioning_files

Test = Literal["etve", "spindle", "axis"]


@dataclass(frozen=True, eq=False)
class Evaluated:
    """Tests, evaluated.

    Parameters
    ----------
    thermal : tuple of ThermalTest
    settlings : tuple of (Recording, tuple of Settling)
        Recordings with the time constants of their channels.
    positioned : tuple of PositioningResult
    """

    thermal: tuple[ThermalTest, ...]
    settlings: tuple[tuple[Recording, tuple[Settling, ...]], ...]
    positioned: tuple[PositioningResult, ...]

    def content(self) -> dict[str, Any]:
        """Return all of it as plain numbers and words."""
        return {
            "thermal": [tables.thermal_content(t) for t in self.thermal],
            "time_constants": [
                {"recording": r.name, "channels": [tables.settling_content(s) for s in mine]}
                for r, mine in self.settlings
            ],
            "positioning": [tables.positioning_content(r) for r in self.positioned],
        }

    def report(self, path: str | Path, *, overwrite: bool = False) -> Path:
        """Write the page that ``thermocomp iso230 -o`` writes; return its path."""
        from thermocomp.iso230.report import iso230 as pages

        pages.write(self.thermal, self.settlings, self.positioned, Path(path), overwrite=overwrite)
        return Path(path)


def evaluate(
    recordings: Sequence[Recording] = (),
    *,
    test: Test | None = None,
    distance: str | None = None,
    pairs: Sequence[str] | None = None,
    ambient: str | None = None,
    models: Sequence[ErrorModel] = (),
    start: Start | None = None,
    limits: Limits | None = None,
    positioning: Sequence[str | Path] = (),
) -> Evaluated:
    """Evaluate thermal tests and positioning tests; the words are those of the command.

    Parameters
    ----------
    recordings : sequence of Recording
        Of thermal tests.
    test : {'etve', 'spindle', 'axis'}, optional
        What they are; found out if not given.
    distance : str, optional
        Between the probes x1 and x2, and y1 and y2, such as ``100 mm``.
    pairs : sequence of str, optional
        Probes of other names, such as ``x_front:x_rear:100mm``.
    ambient : str, optional
        Temperature of the surroundings.
    models : sequence of ErrorModel
        What they leave of each displacement is told beside it.
    start : Start, optional
        How the recordings begin.
    limits : Limits, optional
        Of the compensator; its own if not given.
    positioning : sequence of str or Path
        CSV tables of positioning tests.

    Returns
    -------
    Evaluated

    Raises
    ------
    InputError
        A channel is not there, or a distance has no unit.
    """
    thermal: list[ThermalTest] = []
    settlings = []
    given = {} if limits is None else {"limits": limits}
    for recording in recordings:
        paired = _pairs(recording, distance, pairs)
        mine = part3.assess(recording, test, pairs=paired, ambient=ambient, models=models, start=start, **given)
        # where nothing was recorded of the drives, a test is told to be a warm-up
        phases = find_phases(recording) or tuple(Phase("warm-up", 1, t.start, t.stop) for t in mine if t.kind != "etve")
        thermal += mine
        settlings.append((recording, time_constants(recording, phases, part3.find_stations(recording))))
    positioned = tuple(part2.assess(p) for path in positioning for p in positioning_files.read(Path(path)))
    return Evaluated(tuple(thermal), tuple(settlings), positioned)


def length(text: str, what: str) -> float:
    """Return a length in mm from a text such as ``100 mm``.

    Raises
    ------
    InputError
        It is no number with a unit of length.
    """
    try:
        found = read_with_unit(text, "position")
    except UnitError as e:
        raise InputError(f"{what} {text!r}: {e}") from e
    if found is None or found < 0:
        raise InputError(f'{what} {text!r}: write a number and its unit, such as "100 mm"')
    return found


def _pairs(recording: Recording, distance: str | None, pairs: Sequence[str] | None) -> tuple[Pair, ...]:
    if pairs:
        found = []
        for text in pairs:
            parts = text.split(":")
            if len(parts) != 3:
                raise InputError(
                    f"--pairs {text!r}: write the probe at the tip, the one nearer to the spindle and their distance, "
                    "such as x1:x2:100mm"
                )
            tip, spindle = (part3.find_probe(recording, name.strip()) for name in parts[:2])
            found.append(Pair(tip, spindle, length(parts[2], f"--pairs {text!r}: distance")))
        return tuple(found)
    if distance is None:
        return ()
    paired = part3.find_pairs(recording, length(distance, "--distance"))
    if not paired:
        raise InputError(
            f"--distance: {recording.name} has no probes named x1 and x2, or y1 and y2; name them by --pairs "
            f"TIP:SPINDLE:DISTANCE, of {', '.join(c.name for c in recording.displacements)}"
        )
    return paired

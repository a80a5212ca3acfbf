"""Python functions for thermal tests (ISO 230-3), positioning tests (ISO 230-2) and time constants."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from thermocomp.api.base import Paged
from thermocomp.api.explain import models_of
from thermocomp.api.inputs import Given, Starts, recordings_of, starts_of, trouble_of
from thermocomp.api.keywords import Listener, silent
from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import InputError, UnitError
from thermocomp.core.model import ErrorModel
from thermocomp.core.units import read_with_unit
from thermocomp.iso230 import part2, part3, tables
from thermocomp.iso230.part2 import PositioningResult
from thermocomp.iso230.thermaltest import Pair, ThermalTest
from thermocomp.judging.settling.settling import Phase, Settling, find_phases, time_constants
from thermocomp.recordings.readers.mapping import Mapping
from thermocomp.recordings.recording import Recording
from thermocomp.volumetric.files import positioning as positioning_files

if TYPE_CHECKING:
    from thermocomp.api.results import FittedModels

Test = Literal["etve", "spindle", "axis"]


@dataclass(frozen=True, eq=False)
class Evaluated(Paged):
    """Evaluated tests.

    Parameters
    ----------
    thermal : tuple of ThermalTest
    settlings : tuple of (Recording, tuple of Settling)
        Recordings with the time constants of their channels.
    positioned : tuple of PositioningResult
    trouble : tuple of str
        Data-quality problems of the recordings.
    """

    thermal: tuple[ThermalTest, ...]
    settlings: tuple[tuple[Recording, tuple[Settling, ...]], ...]
    positioned: tuple[PositioningResult, ...]
    trouble: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return all results as a dict, as printed by ``--json``."""
        return {
            "trouble": self.trouble,
            "thermal": [tables.thermal_content(t) for t in self.thermal],
            "time_constants": [
                {"recording": r.name, "channels": [tables.settling_content(s) for s in mine]}
                for r, mine in self.settlings
            ],
            "positioning": [tables.positioning_content(r) for r in self.positioned],
        }

    def page(self) -> str:
        """Return the page that ``thermocomp iso230 -o`` writes."""
        from thermocomp.iso230.report import iso230 as pages

        return pages.render(self.thermal, self.settlings, self.positioned)


def iso230(
    recordings: Given | None = None,
    *,
    test: Test | None = None,
    distance: str | None = None,
    pairs: Sequence[str] | None = None,
    ambient: str | None = None,
    model: "ErrorModel | FittedModels | str | Path | Sequence[ErrorModel] | None" = None,
    limits: Limits = Limits(),
    starts: Starts = None,
    positioning: Sequence[str | Path] = (),
    mapping: str | Path | Mapping | None = None,
    progress: Callable[..., None] = silent,
) -> Evaluated:
    """Evaluate thermal tests after ISO 230-3 and positioning tests after ISO 230-2, and the time constants of channels.

    Parameters
    ----------
    recordings : Recording, path, DataFrame, or sequence of them, optional
        CSV, XLSX or Parquet files of thermal tests.
    test : {'etve', 'spindle', 'axis'}, optional
        Type of the tests: etve (machine at rest), spindle, or axis. Default: determined from the recordings: spindle if
        the spindle turns, else axis if an axis moves, else etve.
    distance : str, optional
        Distance between the probes x1 and x2, and y1 and y2, such as "100 mm". Without it, no tilt is evaluated.
    pairs : sequence of str, optional
        Probe pairs with other names: probe at the tip of the test bar, probe nearer to the spindle, and their distance,
        such as x_front:x_rear:100mm.
    ambient : str, optional
        Channel of the ambient temperature. Default: the first whose name contains air, ambient or room.
    model : ErrorModel, FittedModels, path of a model file, or sequence of ErrorModel, optional
        Model file from thermocomp fit; the residual of each displacement with this model is also reported.
    limits : Limits
        Limits of the compensator: the residual with the compensator is reported, not that of the model alone.
    starts : Start or sequence of Start, optional
        Initial thermal state of the recordings, as for `compare`; used with a model only.
    positioning : sequence of str or Path
        CSV tables of positioning tests, with the columns position_mm, deviation_um, direction (+ or -), run, and, if
        there are several states or axes, state and axis.
    mapping : str, Path or Mapping, optional
        TOML mapping file: role and unit of each column of the recordings.
    progress : callable
        Called with a line of text per recording.

    Returns
    -------
    Evaluated

    Raises
    ------
    InputError
        No input is given, a file or a channel is invalid, or a distance has no unit.

    Examples
    --------
    >>> import thermocomp as tc
    >>> found = tc.iso230(tc.simulate("iso230-spindle"), distance="100 mm")
    >>> [t.name for t in found.thermal]
    ['iso230-spindle-constant', 'iso230-spindle-spectrum']
    >>> first = found.to_dict()["thermal"][0]["curves"][0]
    >>> first["name"], round(first["range_60"], 1)  # um within the first hour
    ('x1_um', 3.4)
    """
    if recordings is None and not positioning:
        raise InputError("no input given: name a recording of a thermal test, or a table with --positioning")
    if recordings is None:
        asked = {"--test": test, "--distance": distance, "--pairs": pairs, "--ambient": ambient, "--model": model}
        for option in (o for o, value in asked.items() if value is not None):
            raise InputError(f"{option} applies to recordings of thermal tests: name a recording")
    if distance is not None and pairs:
        raise InputError("--distance is for probes named x1, x2, y1, y2; --pairs specifies its own distances")
    models = models_of(model) if model is not None else ()
    tests = recordings_of(recordings, mapping) if recordings is not None else []
    begun, trouble = starts_of(starts, tests) or (None,) * len(tests), trouble_of(tests)
    listener = Listener(progress)
    listener.warn(trouble)
    listener.begin(lambda: len(tests))
    thermal: list[ThermalTest] = []
    settlings = []
    for recording, start in zip(tests, begun, strict=True):
        paired = _pairs(recording, distance, pairs)
        mine = part3.assess(recording, test, pairs=paired, ambient=ambient, models=models, start=start, limits=limits)
        # without records of the drives, a test is regarded as a warm-up
        phases = find_phases(recording) or tuple(Phase("warm-up", 1, t.start, t.stop) for t in mine if t.kind != "etve")
        thermal += mine
        settlings.append((recording, time_constants(recording, phases, part3.find_stations(recording))))
        progress(recording.name)
    positioned = tuple(part2.assess(p) for path in positioning for p in positioning_files.read(Path(path)))
    return Evaluated(tuple(thermal), tuple(settlings), positioned, tuple(trouble))


def length(text: str, what: str) -> float:
    """Return a length in mm from a text such as ``100 mm``.

    Raises
    ------
    InputError
        The text is not a number with a unit of length.
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
            f"--distance: {recording.name} has no probes named x1 and x2, or y1 and y2; name the probes with --pairs "
            f"TIP:SPINDLE:DISTANCE, of {', '.join(c.name for c in recording.displacements)}"
        )
    return paired

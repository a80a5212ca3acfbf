"""``thermocomp revise``: an NC program is corrected by the drift it will cause, before it is run."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from rich.console import Console

from thermocomp.cli import reviserun, revisetables
from thermocomp.cli.jsonoutput import print_json
from thermocomp.cli.options import Flag, Json, Output, refuse_existing
from thermocomp.cli.reviseoptions import Controller, Drifting, Starting, Timing, Way
from thermocomp.compensation.nc.drifting.stations import Station
from thermocomp.compensation.nc.reading.tokens import read_lines
from thermocomp.compensation.nc.revising.revise import Revision
from thermocomp.core.exceptions import InputError
from thermocomp.files import ncprogram
from thermocomp.shopfloor import rs274

_console = Console(highlight=False)


def revise(
    program: Path,
    /,
    *,
    drifting: Drifting,
    output: Output,
    starting: Starting = Starting(),
    way: Way = Way(),
    controller: Controller = Controller(),
    timing: Timing = Timing(),
    date: str | None = None,
    overwrite: Flag = False,
    json: Json = False,
) -> int:
    """Correct an NC program by the drift it will cause, before it is run.

    The program is followed as the controller would, timed, and its spindle speed drives the models; what they say is
    taken off its coordinates. What cannot be corrected safely is refused with line and reason. The original stays as it
    is. Beside the new program are written: the differences (.diff), a table of all lines (.csv), a picture (.png), and
    the state that the machine is left in (.job.json), from which the next job can start.

    Parameters
    ----------
    program : Path
        NC program (ISO 6983, as LinuxCNC and Fanuc controls read it).
    drifting : Drifting
        What makes the tool drift.
    output : Path
        Program to write.
    starting : Starting
        How warm the machine is when the program starts.
    way : Way
        How the correction gets into the program.
    controller : Controller
        What stands at the controller and not in the program.
    timing : Timing
        How fast the machine is.
    date : str
        For the header, such as 2026-01-31; today if not given.
    overwrite : bool
        Write over existing files; never over the program.
    json : bool
        Print results for a machine instead of tables.

    Returns
    -------
    int
        0 done, 2 the program or something else cannot be used.
    """
    ncprogram.opened(program).close()
    starting.check()
    found = drifting.stations()
    others, notes = drifting.others(found)
    drift = starting.drift(found, others)
    setup = controller.setup()
    kinematics, guesses = timing.kinematics()
    method = way.made(setup.controller, drift.driven)
    revision = Revision(setup, kinematics, drift, method, way.demand())
    _check_interpreter(way, controller)
    if way.expand and controller.block_delete is None:
        _refuse_optional(program)
    paths = reviserun.Paths.of(output, expanded=way.expand)
    given = (timing.machine, starting.carried, drifting.forecast)
    refuse_existing(paths.all(), overwrite, [program, *drifting.model, *(p for p in given if p is not None)])
    job = reviserun.Job(
        program,
        paths,
        revision,
        drift,
        _files(found, drifting.hashes()),
        starting.words(),
        f"drift counts {starting.counted()}",
        f"method {way.words()}",
        reviserun.moment(date),
        way.interpreter,
        controller.diameters(expand=way.expand),
        way.folders(),
        timing.travel(),
    )
    try:
        done = reviserun.revise(job, hidden=json)
    except InputError as e:
        raise InputError(f"{program}: {e}") from e
    notes += guesses
    if json:
        print_json(revisetables.content(job, done, notes), _console)
    else:
        revisetables.show(job, done, notes, _console)
    return 0


def _files(stations: Sequence[Station], hashes: Mapping[str, str]) -> list[str]:
    """Return which files the models come from, each with what it is for."""
    found = []
    for name in dict.fromkeys(hashes[s.model.target] for s in stations):
        mine = [s for s in stations if hashes[s.model.target] == name]
        places = {a: [s.along for s in mine if s.axis == a] for a in dict.fromkeys(s.axis for s in mine)}
        said = [a if along[0] is None else f"{a} at {len(along)} places of {along[0]}" for a, along in places.items()]
        found.append(f"{name} for {', '.join(said)}")
    return found


def _refuse_optional(program: Path) -> None:
    """Raise `InputError` if the program has optional lines: written out, they would be run always, or never."""
    with ncprogram.opened(program) as lines:
        for line in read_lines(lines):
            if line.optional:
                raise InputError(
                    f"{program}: line {line.number}: an optional line: --expand writes it out as a plain one, or "
                    "leaves it out; say --block-delete off or on"
                )


def _check_interpreter(way: Way, controller: Controller) -> None:
    """Raise `InputError` before any work if the interpreter is asked for and cannot be had."""
    wanted = "--expand" if way.expand else "--interpreter required" if way.interpreter == "required" else ""
    if not wanted:
        return
    if controller.controller != "linuxcnc":
        raise InputError(f"{wanted} is LinuxCNC's interpreter, which does not read Fanuc's programs")
    if (reason := rs274.installed()) is not None:
        raise InputError(f"{wanted}: {reason}")

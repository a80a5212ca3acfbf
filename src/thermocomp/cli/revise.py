"""``thermocomp revise``: an NC program is corrected by the drift it will cause, before it is run."""

import sys
from collections.abc import Mapping, Sequence
from itertools import islice
from pathlib import Path

from rich.console import Console

from thermocomp.adapters.linuxcnc import rs274
from thermocomp.cli import reviseheader, reviserun, revisetables
from thermocomp.cli.jsonoutput import print_json
from thermocomp.cli.options import Flag, Json, Output, refuse_existing
from thermocomp.cli.reviseoptions import Controller, Drifting, Starting, Timing, Way
from thermocomp.cli.revisetravel import Travel
from thermocomp.core.exceptions import InputError
from thermocomp.files import ncprogram
from thermocomp.nc.interpreter.block import Setup
from thermocomp.nc.parser.recognise import program_number
from thermocomp.nc.parser.tokens import read_lines
from thermocomp.nc.rewrite.revise import FIRST, Revision
from thermocomp.nc.thermal.stations import Station

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
        0 done, 1 nothing was taken off and nothing written, 2 the program or something else cannot be used.
    """
    job, notes = prepared(program, drifting, output, starting, way, controller, timing, date, overwrite=overwrite)
    # a pipe gets its lines on stderr, whatever stdout is for
    done = run(job, hidden=json and sys.stderr.isatty())
    if json:
        print_json(revisetables.content(job, done, notes), _console)
    else:
        revisetables.show(job, done, notes, _console)
    return 0 if done.written else 1


def prepared(
    program: Path,
    drifting: Drifting,
    output: Path,
    starting: Starting,
    way: Way,
    controller: Controller,
    timing: Timing,
    date: str | None,
    *,
    overwrite: bool,
) -> tuple[reviserun.Job, list[str]]:
    """Return what is to be done to a program, and notes, or refuse before any work; parameters as for `revise`."""
    if controller.controller is None:
        _refuse_number(program)
    ncprogram.opened(program).close()
    starting.check()
    found = drifting.stations()
    others, notes = drifting.others(found)
    drift = starting.drift(found, others)
    machine = timing.read()
    setup = controller.setup(machine)
    kinematics, guesses = timing.kinematics(machine)
    method = way.made(setup, drift.driven)
    models = _files(found, drifting.hashes())
    header_lines = reviseheader.lines(models, by_position=drift.by_position, unproved=way.unproved)
    revision = Revision(setup, kinematics, drift, method, way.demand(), header_lines, way.split)
    _check_interpreter(way, setup, diameters=controller.diameter is not None)
    if way.expand and setup.controller == "linuxcnc" and controller.block_delete is None:
        _refuse_optional(program)
    paths = reviserun.Paths.of(output, expanded=way.expand)
    given = (timing.machine, starting.carried, drifting.forecast)
    refuse_existing(paths.all(), overwrite, [program, *drifting.model, *(p for p in given if p is not None)])
    job = reviserun.Job(
        program,
        paths,
        revision,
        drift,
        models,
        starting.words(),
        f"drift counts {starting.counted()}",
        f"method {way.words()}",
        reviserun.moment(date),
        unproved=way.unproved,
        diameters=controller.diameters(expand=way.expand),
        subroutines=way.folders(),
        travel=None if machine is None else Travel({a.name: a.travel for a in machine.axes}),
        overwrite=overwrite,
    )
    return job, [*notes, *guesses]


def run(job: reviserun.Job, *, hidden: bool) -> reviserun.Done:
    """Revise a program.

    Raises
    ------
    InputError
        It cannot be revised or proved; the message begins with its name.
    """
    try:
        return reviserun.revise(job, hidden=hidden)
    except InputError as e:
        raise InputError(f"{job.program}: {e}") from e


def _files(stations: Sequence[Station], hashes: Mapping[str, str]) -> list[str]:
    """Return which files the models come from, each with what it is for."""
    found = []
    for name in dict.fromkeys(hashes[s.model.target] for s in stations):
        mine = [s for s in stations if hashes[s.model.target] == name]
        places = {a: [s.along for s in mine if s.axis == a] for a in dict.fromkeys(s.axis for s in mine)}
        said = [a if along[0] is None else f"{a} at {len(along)} places of {along[0]}" for a, along in places.items()]
        unproven = any((h := s.model.honest_error) is not None and h.taken for s in mine)
        found.append(f"{name} for {', '.join(said)}{' UNPROVEN' if unproven else ''}")
    return found


def _refuse_number(program: Path) -> None:
    """Raise `InputError` if a program begins as a Fanuc's do, and nobody has said whose it is."""
    with ncprogram.opened(program) as lines:
        first = list(islice(lines, FIRST))
    if number := program_number(first):
        raise InputError(
            f"{program}: line {number}: {first[number - 1].strip()[:40]!r} is how a Fanuc's or Haas's programs "
            "begin: say --controller fanuc (dwells, cycles and lengths are others there), or --controller linuxcnc"
        )


def _refuse_optional(program: Path) -> None:
    """Raise `InputError` if the program has optional lines: written out, they would be run always, or never."""
    with ncprogram.opened(program) as lines:
        for line in read_lines(lines):
            if line.optional:
                raise InputError(
                    f"{program}: line {line.number}: an optional line: --expand writes it out as a plain one, or "
                    "leaves it out; say --block-delete off or on"
                )


def _check_interpreter(way: Way, setup: Setup, *, diameters: bool) -> None:
    """Raise `InputError` before any work if the interpreter is needed and cannot be had."""
    if way.expand and setup.controller == "linuxcnc" and (reason := rs274.installed()) is not None:
        raise InputError(f"--expand: {reason}")
    if way.expand and setup.controller == "fanuc" and (way.subroutines or diameters):
        raise InputError(
            "--subroutines and --diameter are for LinuxCNC: a Fanuc's subprograms stand in its file, and its G41 stays"
        )
    if not way.unproved and (reason := rs274.installed()):
        raise InputError(f"it cannot be proved: {reason}; {reviserun.ALL_THE_SAME}")

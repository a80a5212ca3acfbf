"""Preparation of a job from the options of a revision; invalid options are refused before any work."""

from collections.abc import Mapping, Sequence
from datetime import date, datetime
from pathlib import Path

from thermocomp.core.exceptions import InputError
from thermocomp.core.outputs import refuse_existing
from thermocomp.nc.interpreter.block import Setup
from thermocomp.nc.interpreter.dialect import check_dialect
from thermocomp.nc.linuxcnc import rs274
from thermocomp.nc.linuxcnc.verification.verify import foresee_sentence
from thermocomp.nc.parser.recognise import recognised
from thermocomp.nc.parser.tokens import program_lines, read_lines
from thermocomp.nc.revision import headers, ncprogram
from thermocomp.nc.revision.job import ALL_THE_SAME, Job, Paths
from thermocomp.nc.revision.options import Controller, Timing, Way
from thermocomp.nc.revision.thermaloptions import Drifting, Starting
from thermocomp.nc.rewrite.course import Travel
from thermocomp.nc.rewrite.revise import Revision
from thermocomp.nc.thermal.stations import Station


def prepare_job(
    program: Path,
    output: Path,
    drifting: Drifting,
    starting: Starting,
    way: Way,
    controller: Controller,
    timing: Timing,
    *,
    when: str | None,
    overwrite: bool,
) -> tuple[Job, list[str]]:
    """Return the job of revising a program, and notes.

    Parameters
    ----------
    when : str or None
        Date for the header. Default: today.
    """
    if controller.controller is None:
        _check_dialect(program, controller)
    ncprogram.open_to_read(program).close()
    starting.check()
    found = drifting.stations()
    others, notes = drifting.others(found)
    drift = starting.drift(found, others)
    machine = timing.read()
    setup = controller.setup(machine)
    kinematics, guesses = timing.kinematics(machine)
    method = way.made(setup, drift.driven)
    models = _files(found, drifting.hashes())
    taken = tuple(dict.fromkeys(h.taken for s in found if (h := s.model.honest_error) is not None and h.taken))
    conditions = way.conditions([*timing.conditions(), *starting.conditions(found, others)])
    states = "" if way.unproved else foresee_sentence(setup)
    revision = Revision(
        setup=setup,
        kinematics=kinematics,
        drift=drift,
        method=method,
        demand=way.demand(),
        header_lines=headers.count_lines(
            models, taken, states, by_position=drift.by_position, conditions=len(conditions.every)
        ),
        split=not way.no_split,
        conditions=conditions,
        stock_top=way.top(),
    )
    _check_interpreter(way, setup, diameters=controller.diameter is not None)
    if way.expand and setup.controller == "linuxcnc" and controller.block_delete is None:
        _refuse_optional(program)
    paths = Paths.of(output, expanded=way.expand)
    given = (timing.machine, starting.carried, drifting.forecast)
    refuse_existing(paths.all(), overwrite, [program, *drifting.model, *(p for p in given if p is not None)])
    job = Job(
        program=program,
        paths=paths,
        revision=revision,
        drift=drift,
        models=models,
        taken=taken,
        start=starting.words(),
        zero=f"drift relative to {starting.counted()}",
        method=f"method {way.words()}",
        when=_moment(when),
        unproved=way.unproved,
        diameters=controller.diameters(expand=way.expand),
        subroutines=way.folders(),
        travel=None if machine is None else Travel({a.name: a.travel for a in machine.axes}),
        overwrite=overwrite,
    )
    if ncprogram.has_mark(program):
        notes.append("the byte-order mark at the beginning of the file, which no control can read, is left out")
    return job, [*notes, *guesses]


def _files(stations: Sequence[Station], hashes: Mapping[str, str]) -> list[str]:
    """Return the files of the models, each with the axes that use them."""
    found = []
    for name in dict.fromkeys(hashes[s.model.target] for s in stations):
        mine = [s for s in stations if hashes[s.model.target] == name]
        places = {a: [s.along for s in mine if s.axis == a] for a in dict.fromkeys(s.axis for s in mine)}
        said = [a if along[0] is None else f"{a} at {len(along)} places of {along[0]}" for a, along in places.items()]
        unproven = any((h := s.model.honest_error) is not None and h.taken for s in mine)
        found.append(f"{name} for {', '.join(said)}{' UNPROVEN' if unproven else ''}")
    return found


def _check_dialect(program: Path, controller: Controller) -> None:
    """Raise `InputError` if the dialect of a program is not specified and may be other than LinuxCNC."""
    startup = f"{controller.startup or ''} {'G20' if controller.units == 'inch' else ''}"
    with ncprogram.open_to_read(program) as texts:
        try:
            lines = recognised(program_lines(texts))
            check_dialect(lines, whole=controller.integers is not None, startup=startup)
        except InputError as e:
            raise InputError(f"{program}: {e}") from e


def _refuse_optional(program: Path) -> None:
    """Raise `InputError` if the program has optional lines: expanded, they would be run always or never."""
    with ncprogram.open_to_read(program) as lines:
        for line in read_lines(lines):
            if line.optional:
                raise InputError(
                    f"{program}: line {line.number}: an optional line: --expand writes it as a plain line, or "
                    "skips it; give --block-delete off or on"
                )


def _check_interpreter(way: Way, setup: Setup, *, diameters: bool) -> None:
    """Raise `InputError` before any work if the interpreter is needed but not available."""
    if way.expand and setup.controller == "linuxcnc" and (reason := rs274.find_obstacle()) is not None:
        raise InputError(f"--expand: {reason}")
    if way.expand and setup.controller == "fanuc" and (way.subroutines or diameters):
        raise InputError(
            "--subroutines and --diameter are for LinuxCNC only: a Fanuc file contains its subprograms, and keeps G41"
        )
    if not way.unproved and (reason := rs274.find_obstacle()):
        raise InputError(f"the revised program cannot be proved: {reason}; {ALL_THE_SAME}")


def _moment(text: str | None) -> datetime:
    """Return the date given by the user, or the present time."""
    if text is None:
        return datetime.now().astimezone()
    try:
        given = date.fromisoformat(text)
    except ValueError as e:
        raise InputError(f"--date {text!r}: write year-month-day, such as 2026-01-31") from e
    return datetime(given.year, given.month, given.day).astimezone()

"""Options that several commands share, and what they stand for."""

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from thermocomp.cli import loudness
from thermocomp.cli.exits import STDIN
from thermocomp.cli.terminal import make_console, words
from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import InputError
from thermocomp.core.zero import Zeroing
from thermocomp.files.draft import refuse_existing
from thermocomp.files.scratch import scratch
from thermocomp.judging.choice import Settings

if TYPE_CHECKING:
    from thermocomp.api.inputs import LeaveOne, Prepared
    from thermocomp.cli.beginning import Beginning
    from thermocomp.judging.results import Rules
    from thermocomp.recordings.recording import Recording

_stderr = make_console(stderr=True)

Quiet = Annotated[bool, Parameter(show=False, parse=False)]
Output = Annotated[Path, Parameter(name=["--output", "-o"])]
OptionalOutput = Annotated[Path | None, Parameter(name=["--output", "-o"])]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class StudyOptions:
    """What is predicted from what, and on what it is judged.

    Parameters
    ----------
    target : list of str
        Displacement channels to predict; left out, the command lists them.
    inputs : list of str
        Channels to predict from; all temperatures and the first spindle speed if not given.
    mapping : Path
        TOML file that says what the columns are.
    split : str
        Judge by time: shares of the rows such as 0.75/0.25, or hours such as 20h/8h.
    leave_one_cycle_out : bool
        Judge on each thermal cycle in turn (what is done if nothing is said).
    leave_one_day_out : bool
        Judge on each day in turn; the recordings need time stamps.
    leave_one_file_out : bool
        Judge on each recording in turn.
    absolute : bool
        Take temperatures as they are; without it they are counted from the start of each test.
    harm_margin : float
        Harm in a single cycle, day or file that is let pass [um]. If not given: three times the probe's noise or 5 % of
        the largest drift, at most 2 um.
    zero_over : float
        Average that start over so long, while the spindle stands [s]; 0: it is the first row.
    jobs : int
        Processes to share the work among; -1 takes all cores.
    scheduler : str
        Dask scheduler whose workers do the work in place of these processes, such as tcp://192.168.1.20:8786.
    """

    target: list[str] | None = None
    inputs: list[str] | None = None
    mapping: Path | None = None
    split: str | None = None
    leave_one_cycle_out: bool = False
    leave_one_day_out: bool = False
    leave_one_file_out: bool = False
    absolute: bool = False
    harm_margin: float | None = None
    zero_over: float = Zeroing.at_rest
    jobs: int = -1
    scheduler: str | None = None

    def prepare(
        self,
        paths: list[Path],
        beginning: "Beginning",
        outputs: Sequence[Path | None],
        overwrite: bool,
        ending: str,
        *,
        tilt: list[str] | None = None,
        judged: bool = True,
    ) -> "Prepared":
        """Read recordings, say what is wrong with them, and return all that judging begins with.

        Before any work it is made sure that the outputs can be written.
        """
        tests = read_recordings(paths, self.mapping)
        from thermocomp.api.inputs import prepare
        from thermocomp.recordings.tilts import with_tilts

        if not self.target:
            raise InputError(f"name what to predict with --target: {_displacements(tests)}")
        tests, names = with_tilts(tests, tilt) if tilt else (tests, [])
        refuse_existing([path for path in outputs if path is not None], overwrite, paths, ending)
        if self.jobs == 0:
            raise InputError("--jobs 0: name a number of processes, or -1 for all cores")
        speed = tests[0].speed
        ready = prepare(
            tests,
            [*self.target, *names],
            self.inputs,
            absolute=self.absolute,
            starts=beginning.of(tests, self.mapping),
            zeroing=Zeroing(
                self.zero_over, min(self.zero_over, Zeroing.otherwise), speed.name if speed is not None else ""
            ),
            split=self.split,
            leave_one=self._left_out(),
            judged=judged,
        )
        _told(ready.trouble)
        return ready

    def _left_out(self) -> "LeaveOne | None":
        units: dict[LeaveOne, bool] = {
            "cycle": self.leave_one_cycle_out,
            "day": self.leave_one_day_out,
            "file": self.leave_one_file_out,
        }
        named: list[LeaveOne] = [unit for unit, asked in units.items() if asked]
        if (self.split is not None) + len(named) > 1:
            ways = ", ".join(f"--leave-one-{unit}-out" for unit in units)
            raise InputError(f"--split, {ways} exclude each other: choose one")
        return named[0] if named else None

    def rules(self, primary: str | None = None) -> "Rules":
        """Return what is stated before judging."""
        from thermocomp.judging.results import Rules

        return Rules(self.harm_margin, primary)


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class CompensatorOptions:
    """What the compensator that is judged with a model may never do.

    Parameters
    ----------
    magnitude : float
        Largest correction in either direction [um].
    rate : float
        Fastest change of a correction [um/s].
    dead_band : float
        Changes smaller than this are not made [um].
    """

    magnitude: float = Limits.magnitude
    rate: float = Limits.rate
    dead_band: float = Limits.dead_band

    def limits(self) -> Limits:
        """Return them as the compensator takes them."""
        return Limits(self.magnitude, self.rate, self.dead_band)


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Selector(Settings):  # noqa: D101 - that of Settings, which the help is made from
    __doc__ = Settings.__doc__

    unsigned: bool = False
    models: list[str] = field(default_factory=lambda: ["ols", "averaged"])
    holm: bool = False


def read_recordings(paths: list[Path], mapping: Path | None, *, tell: bool = True) -> "list[Recording]":
    """Read the recordings named on the command line; ``-`` is a CSV file on standard input.

    What a mapping changes in the values is told on stderr, unless `tell` is False: then it is shown elsewhere.
    """
    if not paths:
        raise InputError("no recording given: name at least one CSV, XLSX or Parquet file")
    from thermocomp.recordings.readers import mapping as mappings
    from thermocomp.recordings.readers.mending import read_or_offer

    columns = mappings.read_mapping(mapping) if mapping is not None else None
    found = _read_all(paths, lambda named: [read_or_offer(p, columns) for p in named])
    loudness.tell_read(found)
    for r in found if tell and not loudness.quiet else ():
        for change in r.changed:
            _stderr.print(f"[dim]note[/] {words(f'{r.name}: {change}')}", soft_wrap=True)
    return found


def _read_all(paths: list[Path], read: "Callable[[list[Path]], list[Recording]]") -> "list[Recording]":
    if STDIN not in paths:
        return read(paths)
    from thermocomp.recordings.readers.limits import Limits as FileLimits

    if paths.count(STDIN) > 1:
        raise InputError("-: there is one standard input")
    with scratch() as folder:
        typed = folder / "stdin.csv"
        with typed.open("wb") as file:
            while block := sys.stdin.buffer.read(1 << 20):
                FileLimits().check("file_bytes", file.tell() + len(block), "standard input")
                file.write(block)
        return read([typed if p == STDIN else p for p in paths])


def _displacements(tests: "Sequence[Recording]") -> str:
    names = dict.fromkeys(c.name for test in tests for c in test.displacements)
    return ", ".join(names) or "no recording has a displacement"


def tell_trouble(tests: "Sequence[Recording]") -> list[str]:
    """Say on stderr what is wrong with recordings that are about to be used, and give it back.

    Parameters
    ----------
    tests : sequence of Recording

    Returns
    -------
    list of str
        One line per trouble, and per column that was left out.
    """
    from thermocomp.api.inputs import trouble_of

    return _told(trouble_of(tests))


def _told(lines: list[str]) -> list[str]:
    for line in () if loudness.quiet else lines:
        _stderr.print(f"[bold yellow]trouble[/] {words(line)}", soft_wrap=True)
    return lines

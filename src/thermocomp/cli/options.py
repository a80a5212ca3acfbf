"""Options that several commands share, and what they stand for."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from thermocomp.cli.beginning import Beginning
from thermocomp.cli.reading import print_trouble, read_recordings
from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import InputError
from thermocomp.core.zero import Zeroing
from thermocomp.files.draft import refuse_existing
from thermocomp.judging.choice import Settings

if TYPE_CHECKING:
    from thermocomp.api.inputs import LeaveOne, Prepared
    from thermocomp.judging.results import Rules
    from thermocomp.recordings.recording import Recording

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
        Tolerated degradation in a single cycle, day or file [um]. If not given: three times the probe's noise or 5 % of
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
        beginning: Beginning,
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
        print_trouble(ready.trouble)
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


def _displacements(tests: "Sequence[Recording]") -> str:
    names = dict.fromkeys(c.name for test in tests for c in test.displacements)
    return ", ".join(names) or "no recording has a displacement"

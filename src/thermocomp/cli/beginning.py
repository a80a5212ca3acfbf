"""Initial thermal state of recordings: command-line options."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from cyclopts import Parameter

from thermocomp.cli.reading import read_recordings
from thermocomp.core.exceptions import InputError

if TYPE_CHECKING:
    from thermocomp.recordings.recording import Recording
    from thermocomp.recordings.starts import Start


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Beginning:
    """Initial thermal state of the recordings. Default: determined from the recordings.

    Parameters
    ----------
    start : str
        Initial thermal state. cold: at rest at the start, which is the zero (reference); continued: continued from the
        files of --continues, with their zero; rezeroed: all values are relative to the start, where the machine may be
        warm; known: temperatures are relative to those of --zero. Default: determined from the recordings.
    continues : list of Path
        Earlier files of the same test, in chronological order. With --start rezeroed they provide only the thermal
        history: all values are relative to the start of the recording.
    gap : float
        Time from the end of each file of `--continues` to the start of the next one [s]. Default: from the time stamps,
        else one sampling interval.
    zero : str
        Temperatures at which the displacements were zeroed, such as t1_C=20.1,t2_C=20.4, or a recording that starts at
        these temperatures.
    """

    start: Literal["cold", "continued", "rezeroed", "known"] | None = None
    continues: list[Path] | None = None
    gap: float | None = None
    zero: str | None = None

    def of(self, tests: "Sequence[Recording]", mapping: Path | None) -> "Start | None":
        """Return the initial thermal state of `tests`; None: determined from the recordings.

        Raises
        ------
        InputError
            The options exclude each other, or a file or a channel is missing.
        """
        if self.gap is not None and not self.continues:
            raise InputError("--gap is the time between two files: name the earlier one with --continues")
        if self.zero is not None and self.start not in (None, "known"):
            raise InputError(f"--zero requires --start known, not {self.start}")
        if self.continues and self.start not in (None, "continued", "rezeroed"):
            raise InputError(f"--continues requires --start continued or rezeroed, not {self.start}")
        if self.continues and len(tests) != 1:
            raise InputError(f"--continues: {len(tests)} recordings are given; give only the one that continues")
        word = self.start or ("continued" if self.continues else "known" if self.zero is not None else None)
        if word is None:
            return None
        if not tests:
            raise InputError(f"--start {word}: applies to a single recording; name one")
        earlier = tuple(read_recordings(self.continues, mapping)) if self.continues else ()
        for e in earlier:
            if e.fingerprint == tests[0].fingerprint:
                raise InputError(
                    f"--continues {e.source}: this is the recording itself; name the file recorded before it"
                )
        from thermocomp.recordings.starts import Start

        return Start(
            word=word,
            why="stated",
            earlier=earlier,
            gap=self.gap,
            zero=_zero(self.zero, tests[0], mapping) if self.zero else {},
        )


def _zero(text: str, test: "Recording", mapping: Path | None) -> dict[str, float]:
    """Return temperatures by channel, from a text or from the start of a recording."""
    from thermocomp.core.zero import Zeroing
    from thermocomp.recordings.starts import level

    if "=" not in text:
        (other,) = read_recordings([Path(text)], mapping)
        zeroing = Zeroing(speed=other.speed.name if other.speed is not None else "")
        return {c.name: level(other, c.name, zeroing) for c in other.temperatures}
    found = {}
    for part in text.split(","):
        name, _, value = part.partition("=")
        try:
            found[test.channel(name.strip()).name] = float(value)
        except ValueError as e:
            raise InputError(f"--zero {part!r}: write a channel and its temperature, such as t1_C=20.1") from e
    return found

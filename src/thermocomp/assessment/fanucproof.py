"""A revised program of a Fanuc is proved in LinuxCNC's words: original and revised are translated, and run there.

Only what the translation holds is proved: what a Fanuc does beyond it (its own rounding, its path) is not.
"""

from array import array
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from thermocomp.assessment.ledger import Integers, Ledger, Shifts
from thermocomp.assessment.precompensation import Proof, prove
from thermocomp.assessment.translation import Translator, UntranslatableError
from thermocomp.compensation.nc.following.block import Setup
from thermocomp.compensation.nc.reading.tokens import program_lines
from thermocomp.core.exceptions import ProgramError, Unprovable


class TranslatedLedger(Ledger):
    """What the lines of a translation should be shifted by.

    Parameters
    ----------
    ledger : Ledger
        Of the program.
    original, revised : array of int
        For each line of the two translations, from the first: the line it comes from.
    stops : array of int
        Lines of the original's translation that end on the way of their line: a cycle that goes up afterwards.
    """

    def __init__(self, ledger: Ledger, original: "array[int]", revised: "array[int]", stops: "array[int]") -> None:
        super().__init__()
        self._ledger = ledger
        self._sources, self._revised, self._stops = (np.array(a, dtype=int) for a in (original, revised, stops))
        last = len(self._sources) + 1
        # first and last line of the translation of each line of the original
        lines = np.arange(1, last)
        size = int(self._sources.max(initial=0)) + 2
        self._begin, self._end = np.full(size, last), np.zeros(size, dtype=int)
        np.minimum.at(self._begin, self._sources, lines)
        np.maximum.at(self._end, self._sources, lines)

    def of(self, lines: Integers) -> Shifts:
        """Return what lines of the original's translation should be shifted by."""
        shifts = self._ledger.of(self.source(lines))
        on_the_way = np.isin(lines, self._stops)
        return shifts._replace(after=np.where(on_the_way[:, None], shifts.inner, shifts.after))

    def originals(self, lines: Integers) -> Integers:
        """Return the lines of the original's translation that lines of the revised one's come from.

        Those of one line of the original belong together from the last one on: what is added comes before.
        """
        known = (lines >= 1) & (lines <= len(self._revised))
        index = np.where(known, lines - 1, 0)
        if not len(self._revised):
            return lines
        mine = self._revised[index]
        behind = np.searchsorted(self._revised, mine, side="right") - index - 1
        source = np.clip(self._ledger.originals(mine), 0, len(self._end) - 1)
        found = np.maximum(self._end[source] - behind, self._begin[source])
        return np.where(known, found, lines)

    def source(self, lines: Integers) -> Integers:
        """Return the lines of the original that lines of its translation come from; 0 for none."""
        known = (lines >= 1) & (lines <= len(self._sources))
        if not len(self._sources):
            return np.zeros_like(lines)
        return np.where(known, self._sources[np.where(known, lines - 1, 0)], 0)

    @property
    def lines(self) -> int:
        """Number of lines of the translation."""
        return len(self._sources)


def prove_fanuc(
    original: Path,
    revised: Path,
    ledger: Ledger,
    setup: Setup,
    progress: Callable[[int], object] = lambda _: None,
) -> Proof:
    """Translate a Fanuc's program and what it was revised to, and have LinuxCNC's interpreter compare them.

    Parameters
    ----------
    original, revised : Path
        The programs, in plain lines.
    ledger : Ledger
        What the lines of the original should be shifted by.
    setup : Setup
        That of the revision.
    progress : callable, optional
        Told the line of the original.

    Returns
    -------
    Proof
        Of the translations.

    Raises
    ------
    ProgramError
        A move is not where it should be; see `thermocomp.assessment.precompensation.prove`.
    Unprovable
        The program cannot be said in LinuxCNC's words, or the interpreter does not run it, or is not installed.
    """
    with TemporaryDirectory(prefix="translated-") as name:
        folder = Path(name)
        sources: list[array[int]] = []
        translators = Translator(setup), Translator(setup)
        for path, translator in zip((original, revised), translators, strict=True):
            sources.append(_write(path, folder / f"{len(sources)}.ngc", translator))
        own = TranslatedLedger(ledger, sources[0], sources[1], translators[0].stops)
        try:
            proof = prove(
                folder / "0.ngc",
                folder / "1.ngc",
                own,
                translators[0].setup(),
                lambda line: progress(int(own.source(np.array([line]))[0])),
            )
            return proof._replace(held=("what it is in LinuxCNC's words", *proof.held))
        except ProgramError as e:
            raise ProgramError(int(own.source(np.array([e.line]))[0]) or e.line, e.reason) from e


def _write(path: Path, out: Path, translator: Translator) -> "array[int]":
    """Translate a program into a file; return where its lines come from."""
    sources = array("i")
    with path.open(encoding="latin-1", newline="") as lines, out.open("w", encoding="ascii", newline="\n") as file:
        try:
            for text, line in translator.translate(program_lines(lines)):
                file.write(text)
                sources.append(line)
        except UntranslatableError as e:
            raise Unprovable(f"line {e.line} cannot be said in LinuxCNC's words: {e.reason}") from e
    return sources

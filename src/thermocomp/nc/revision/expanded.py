"""A program is written out in plain lines before it is revised (``--expand``)."""

from array import array
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from thermocomp.nc.expansion.unroll import unroll
from thermocomp.nc.interpreter.block import Setup
from thermocomp.nc.linuxcnc.expansion.expand import expand
from thermocomp.nc.parser.tokens import program_lines
from thermocomp.nc.revision import ncprogram


def write_expanded(
    program: Path,
    out: Path,
    setup: Setup,
    diameters: Mapping[int, float] | None,
    subroutines: Sequence[Path],
    progress: Callable[[int], object],
) -> "array[int]":
    """Write a program out: LinuxCNC's by its interpreter, a Fanuc's by an unroller of our own.

    Parameters
    ----------
    program, out : Path
    setup : Setup
    diameters : dict of int to float, optional
        Tool diameters [mm], for LinuxCNC.
    subroutines : sequence of Path
        Folders of subprograms, for LinuxCNC.
    progress : callable
        Told how many lines are written of LinuxCNC's.

    Returns
    -------
    array of int
        For each line of `out`, from the first: the line of the program it comes from; 0: of none.

    Raises
    ------
    InputError
        It cannot be written out.
    """
    if setup.controller == "linuxcnc":
        return expand(
            program,
            out,
            inch=setup.inch,
            startup=setup.startup or None,
            diameters=diameters,
            block_delete=setup.skip_optional,
            subroutines=subroutines,
            progress=progress,
        ).sources
    sources = array("I")
    with ncprogram.open_to_read(program) as texts, ncprogram.open_to_write(out) as file:
        for text, line in unroll(program_lines(texts), setup):
            file.write(text)
            sources.append(line)
    return sources

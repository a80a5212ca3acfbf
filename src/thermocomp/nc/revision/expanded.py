"""Expansion of a program into plain lines before its revision (``--expand``)."""

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
    """Expand a program: one for LinuxCNC by its interpreter, one for a Fanuc by a built-in unroller.

    Parameters
    ----------
    program, out : Path
    setup : Setup
    diameters : dict of int to float, optional
        Tool diameters [mm], for LinuxCNC.
    subroutines : sequence of Path
        Folders of subprograms, for LinuxCNC.
    progress : callable
        Called with the number of lines written, for LinuxCNC only.

    Returns
    -------
    array of int
        For each line of `out`: number of its line in the program; 0 if it has none.

    Raises
    ------
    InputError
        The program cannot be expanded.
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

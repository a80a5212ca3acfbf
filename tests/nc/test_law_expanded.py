"""All programs of the linuxcnc package: revised as text where that is safe, unrolled where not, or refused."""

from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
from nc_interpreter import PROGRAMS, needs_programs
from nc_law import STATED, Growing, Trial, revise

from thermocomp.core.exceptions import InputError, ProgramError
from thermocomp.nc.linuxcnc import rs274
from thermocomp.nc.linuxcnc.expansion.expand import expand

pytestmark = pytest.mark.usefixtures("interpreter")

#: what the programs do not say: their rotary axes turn the workpiece, too
SAID = replace(STATED, rotary=dict.fromkeys("ABC", "table"))
#: at least this share of the programs that the interpreter runs is revised
SHARE = 0.7
#: diameters of all tools
ZERO = dict.fromkeys(range(1, rs274.HIGHEST_TOOL), 0.0)
#: where subprograms of the package stand
FOLDERS = [PROGRAMS, *(PROGRAMS / name for name in ("ngcgui_lib", "ngcgui_lib/utilitysubs", "remap_lib"))]


def accepted(path: Path) -> int | None:
    """Return how many moves the interpreter makes of a program; None: it does not run it."""
    try:
        return sum(c.kind in ("rapid", "feed", "arc") for c in rs274.read(path, subroutines=FOLDERS))
    except ProgramError:
        return None


def unrolled(path: Path, folder: Path) -> Trial | InputError:
    """Revise what the interpreter makes of a program."""
    plain = folder / f"plain-{path.name}"
    try:
        expand(path, plain, inch=False, startup="G64 G99", diameters=ZERO, subroutines=FOLDERS, user_codes=True)
        return revise(plain, folder, Growing(rate=(0.01, -0.01, 0.02)), "coordinates", setup=SAID)
    except InputError as error:
        return error
    finally:
        rest = folder / f"{plain.name}.part"
        assert not rest.exists()


@pytest.mark.long
@needs_programs
def test_most_programs_of_linuxcnc_are_revised_and_none_wrongly(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    counts: Counter[str] = Counter()
    moving: Counter[str] = Counter()
    refused = []
    for number, path in enumerate(sorted(PROGRAMS.rglob("*.ngc"))):
        moves = accepted(path)
        if moves is None:
            counts["not run by the interpreter"] += 1
            continue
        folder = tmp_path / str(number)
        folder.mkdir()
        try:
            trial: Trial | InputError = revise(
                path, folder, Growing(rate=(0.01, -0.01, 0.02)), "coordinates", setup=SAID
            )
            how = "revised as text"
        except ProgramError:
            trial, how = unrolled(path, folder), "revised when unrolled"
        if isinstance(trial, Trial):
            trial.proved()
        else:
            how = "refused"
            assert isinstance(trial, ProgramError)
            assert "please report" not in trial.reason
            refused.append(f"{path.relative_to(PROGRAMS)}: {trial}")
        counts[how] += 1
        moving[how] += moves > 0
    with capsys.disabled():
        print(f"\n{counts.total()} programs: {dict(counts)}; of these with moves: {dict(moving)}")
        print("\n".join(refused))
    for found in (counts, moving):
        revised = found["revised as text"] + found["revised when unrolled"]
        assert revised >= SHARE * (revised + found["refused"])

"""`thermocomp linuxcnc`: what a LinuxCNC needs to be corrected."""

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from thermocomp.cli.jsonoutput import print_json
from thermocomp.cli.terminal import console, words
from thermocomp.live.adapters.linuxcnc.halsetup import HAL_NAME, HalSettings, Pattern, set_up

_Folder = Annotated[Path | None, Parameter(name=["--output", "-o"])]


def linuxcnc(
    what: Literal["setup"],
    ini: Path,
    /,
    *,
    pattern: Pattern = "offset",
    axes: str = "Z",
    magnitude: float = 500.0,
    rate: float = 0.5,
    timeout: float = 2.0,
    hold: float = 1800.0,
    fade: float = 0.1,
    group: str = "",
    output: _Folder = None,
    overwrite: bool = False,
    json: bool = False,
) -> int:
    """Write what a LinuxCNC needs to be corrected, and say what to change in its configuration.

    Nothing that is there is changed: a HAL file and a component are written beside the INI file.

    Parameters
    ----------
    what : {'setup'}
        What to do.
    ini : Path
        INI file of the machine.
    pattern : {'offset', 'drive'}
        How corrections come in. offset: external offsets, which the controller knows of and keeps within its soft
        limits; drive: between the controller and the drive, which the position display does not show.
    axes : str
        Letters of the axes to correct, such as XZ.
    magnitude : float
        Largest correction, whatever the service says [um].
    rate : float
        Fastest change of a correction, the same [um/s].
    timeout : float
        The service counts as lost when it says nothing for so long [s].
    hold : float
        So long corrections then stay as they are [s].
    fade : float
        How fast they go to zero after that [um/s].
    group : str
        Group whose members may connect; without it only the user that runs LinuxCNC.
    output : Path
        Another folder for the files.
    overwrite : bool
        Write over existing files.
    json : bool
        Print what was done for a program instead.

    Returns
    -------
    int
        0 written, 2 the machine cannot be corrected like this.
    """
    assert what == "setup"
    settings = HalSettings(
        pattern=pattern,
        axes=axes,
        magnitude=magnitude,
        rate=rate,
        timeout=timeout,
        hold=hold,
        fade=fade,
        group=group,
    )
    folder = ini.parent if output is None else output
    found = set_up(ini, folder, settings, overwrite=overwrite)
    if json:
        files = [str(path) for path in found.files]
        print_json({"files": files, "socket": str(found.socket), "todo": list(found.todo)})
        return 0
    console.print(f"Written: {words(str(folder / HAL_NAME))}, and the component that it starts.", soft_wrap=True)
    for k, one in enumerate(found.todo, 1):
        console.print(words(f"{k}. {one}"), soft_wrap=True)
    console.print(f"The service connects at {words(str(found.socket))}.", soft_wrap=True)
    return 0

"""`thermocomp linuxcnc`: setup of LinuxCNC for corrections."""

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
    """Write the files that LinuxCNC needs for corrections, and list the changes to its configuration.

    Existing files are not changed: a HAL file and a component are written next to the INI file.

    Parameters
    ----------
    what : {'setup'}
        Action; setup is the only one.
    ini : Path
        INI file of the machine.
    pattern : {'offset', 'drive'}
        How the corrections are applied. offset: as external offsets, which the controller displays and keeps within its
        soft limits; drive: between controller and drive, where the position display does not show them.
    axes : str
        Letters of the axes to correct, such as XZ.
    magnitude : float
        Largest correction, whatever the service sends [um].
    rate : float
        Fastest change of a correction, whatever the service sends [um/s].
    timeout : float
        Time without a message after which the service counts as disconnected [s].
    hold : float
        Hold time of the corrections after a disconnect [s].
    fade : float
        Rate at which corrections ramp to zero after the hold time [um/s].
    group : str
        User group whose members may send corrections. Default: only the user that runs LinuxCNC.
    output : Path
        Output folder. Default: the folder of the INI file.
    overwrite : bool
        Overwrite existing files.
    json : bool
        Print results as JSON instead of text.

    Returns
    -------
    int
        0 files written, 2 the machine cannot be corrected with these settings.
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

"""`thermocomp serve`: the compensator beside the controller, live."""

import asyncio
import contextlib
import signal
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from thermocomp.cli.extras import needs
from thermocomp.cli.terminal import console, words
from thermocomp.core.draft import write_text
from thermocomp.core.exceptions import InputError

if TYPE_CHECKING:
    from thermocomp.service.loop import Service

#: seconds of the virtual machine in one of the world, in the demo
_SPEED = 60

#: what the demo's model knows the virtual machine by
_TARGETS = ("x1_um", "y1_um", "z_um")
_INPUTS = (
    *("t_housing_C", "t_motor_C", "t_column_front_left_C", "t_z_bearing_C", "t_table_C", "t_enclosure_C"),
    "spindle_rpm",
)


def serve(
    config: Path | None = None,
    /,
    *,
    demo: bool = False,
    port: int | None = None,
    output: Path = Path("thermocomp-live"),
    check: bool = False,
) -> int:
    """Run the compensator live: sensors in, corrections out, with a page to watch.

    Parameters
    ----------
    config : Path
        TOML file: models, sources, sinks, limits, page.
    demo : bool
        Without a configuration: the virtual machine at 60 times the speed of the world, with a model that is fitted to
        a recording of it first (half a minute).
    port : int
        Of the page, in place of the configured one; 0: any that is free.
    output : Path
        Folder of the demo: its model, state and corrections.
    check : bool
        Only read the configuration and what it names, and say what is wrong.

    Returns
    -------
    int
        0 stopped as asked.
    """
    with needs("live"):
        from thermocomp.service.build import build
        from thermocomp.service.config import Page, read_config
    if (config is None) != demo:
        raise InputError("name a configuration (a TOML file), or --demo")
    path = _demo(output) if config is None else config
    settings = read_config(path)
    if port is not None:
        page = settings.config.page or Page()
        settings = settings._replace(config=replace(settings.config, page=replace(page, port=port)))
    service = build(settings)
    for target in service.compensator.lines:
        order = service.state.orders.get(target)
        console.print(
            words(f"{target}: {'runs' if order is None else f'{order.word}: {order.reason}'}"), soft_wrap=True
        )
    if not check:
        asyncio.run(_run(service))
    return 0


async def _run(service: "Service") -> None:
    loop, task = asyncio.get_running_loop(), asyncio.current_task()
    assert task is not None
    for name in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(name, task.cancel)
    with contextlib.suppress(asyncio.CancelledError):
        await service.run()
    console.print("stopped: the corrections stay as they are; the state is saved")


def _demo(folder: Path) -> Path:
    """Return the configuration of the demo, in a folder that is made if it is not there."""
    config, model = folder / "serve.toml", folder / "model.json"
    folder.mkdir(parents=True, exist_ok=True)
    if not model.exists():
        console.print("A model of the virtual machine is fitted to a recording of it, half a minute ...")
        with needs("study"):
            from thermocomp.api.verbs import fit, simulate
        fit(simulate("demo"), _TARGETS, inputs=_INPUTS, jobs=-1).save(model)
    if not config.exists():
        text = _CONFIG.format(speed=_SPEED)
        write_text(text, config, overwrite=False)
    return config


_CONFIG = """# thermocomp serve --demo: the virtual machine, {speed} times as fast as the world
models = ["model.json"]
state = "state.json"
speed = {speed}.0

[[sources]]
kind = "simulated"
experiment = "demo"
seed = 7

[[sinks]]
kind = "file"
file = "corrections.json"

[page]
port = 8731
"""

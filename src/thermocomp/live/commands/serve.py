"""`thermocomp serve`: live compensation."""

import asyncio
import contextlib
import secrets
import signal
from collections.abc import Coroutine, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from thermocomp.cli.extras import needs
from thermocomp.cli.terminal import console, words
from thermocomp.core.alone import alone
from thermocomp.core.exceptions import InputError
from thermocomp.files.draft import write_text

if TYPE_CHECKING:
    from thermocomp.live.config import ServiceSettings
    from thermocomp.live.loop import Service

#: speed of the virtual machine relative to real time, in the demo
_SPEED = 60

#: targets and inputs of the demo's model
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
    """Run the compensator live: sensors in, corrections out, with a web page to monitor it.

    Parameters
    ----------
    config : Path
        TOML configuration file: models, sources of readings, sinks for corrections, limits, web page.
    demo : bool
        Run a demo without a configuration: the virtual machine at 60 times real time, with a model that is first fitted
        to a recording of it (this takes a minute or more).
    port : int
        Port of the web page; overrides the configured one. 0: any free port.
    output : Path
        Output folder of the demo: its model, state and corrections.
    check : bool
        Only check the configuration and the files it names, and report problems.

    Returns
    -------
    int
        0 stopped on request.
    """
    with needs("live"):
        from thermocomp.live.config import read_config
    if (config is None) != demo:
        raise InputError("give either a configuration (a TOML file) or --demo")
    path = _demo(output) if config is None else config
    settings = read_config(path)
    own, journal = settings.config.state, settings.config.journal
    with contextlib.ExitStack() as stack:
        for name in (own, journal.file if journal else ""):
            if name and not check and (settings.folder / name).parent.is_dir():
                stack.enter_context(alone(settings.folder / name))
        return _serve(settings, port, check=check)


def _serve(settings: "ServiceSettings", port: int | None, *, check: bool) -> int:
    from thermocomp.live.build import build
    from thermocomp.live.config import Page
    from thermocomp.live.findings import find_faults, find_faults_now
    from thermocomp.live.page import orders, web
    from thermocomp.live.page.page import make_app

    page = settings.config.page
    if port is not None:
        page = replace(page or Page(), port=port)
    if check and (found := [*find_faults(settings), *find_faults_now(settings, page)]):
        raise InputError("\n".join(["invalid configuration:", *(f"  {f}" for f in found)]))
    service = build(settings)
    for target in service.compensator.lines:
        order, there = service.state.orders.get(target), service.find_status(target)[1]
        told = f"{order.word}: {order.reason}" if order else there.reason if there.word == "no sink" else "may run"
        console.print(words(f"{target}: {told}"), soft_wrap=True)
    token = web.read_token(settings.folder / page.token_file) if page is not None and page.token_file else ""
    if check:
        return 0
    work: list[Coroutine[Any, Any, None]] = []
    service.in_force.way = lambda _target, _order: orders.NO_TOKEN
    if page is not None:
        listening = web.listen(page.host, page.port)
        host, number = listening.getsockname()[:2]
        where = f"[{host}]" if ":" in host else host
        console.print(words(f"Page: http://{where}:{number}"), soft_wrap=True)
        if token:
            here = {"0.0.0.0": "127.0.0.1", "[::]": "[::1]"}.get(where, where)
            kept = (settings.folder / page.token_file).resolve()
            service.in_force.way = partial(orders.explain_way, url=f"http://{here}:{number}", token_file=kept)
        app = make_app(service, token, page.settled, (page.host, *page.hosts), page.pages)
        work.append(web.serve(app, listening))
    asyncio.run(_run(service, settings.config.at_stop == "fade", [service.run(), *work]))
    return 0


async def _run(service: "Service", fades: bool, work: Sequence[Coroutine[Any, Any, None]]) -> None:
    loop, task = asyncio.get_running_loop(), asyncio.current_task()
    assert task is not None
    fading: list[asyncio.Task[None]] = []

    def stop() -> None:
        if not fades or fading:  # a second stop request skips the fade
            task.cancel()
            return
        console.print("stopping: the corrections fade to zero first; stop again to skip this")
        fading.append(asyncio.create_task(service.fade_out()))
        fading[0].add_done_callback(lambda _: task.cancel())

    for name in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(name, stop)
    with contextlib.suppress(asyncio.CancelledError):
        async with asyncio.TaskGroup() as group:
            for one in work:
                group.create_task(one)
    kept = f"the state is not saved: {service.keeper.not_saved}" if service.keeper.not_saved else "the state is saved"
    console.print(words(f"stopped: the corrections keep their present values; {kept}"), soft_wrap=True)


def _demo(folder: Path) -> Path:
    """Return the configuration of the demo, in a folder that is created if missing."""
    config, model = folder / "serve.toml", folder / "model.json"
    folder.mkdir(parents=True, exist_ok=True)
    if not model.exists():
        console.print("Fitting a model of the virtual machine to a recording of it (a minute or more) ...")
        with needs("study"):
            from thermocomp.api.verbs import fit
        from thermocomp.virtual.verbs import simulate

        fit(simulate("demo"), _TARGETS, "averaged", inputs=_INPUTS, jobs=-1).save(model)
    if not config.exists():
        text = _CONFIG.format(speed=_SPEED)
        write_text(text, config, overwrite=False)
    if not (token := folder / "token.txt").exists():
        write_text(secrets.token_hex(16) + "\n", token, overwrite=False)
        token.chmod(0o600)
    console.print(words(f"Token for the page's buttons: {token}"), soft_wrap=True)
    return config


_CONFIG = """# thermocomp serve --demo: the virtual machine at {speed} times real time
models = ["model.json"]
state = "state.json"
speed = {speed}.0
own_compensation = "off"
first_start = "zero"

[[sources]]
kind = "simulated"
experiment = "demo"
seed = 7

[[sinks]]
kind = "file"
file = "corrections.json"

[[probes]]
kind = "simulated"
every = 7200.0

[journal]
file = "live.db"

[page]
port = 8731
token_file = "token.txt"
"""

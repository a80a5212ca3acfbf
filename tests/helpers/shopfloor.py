"""A shop floor of real parts: the virtual machine, a real broker, `thermocomp serve`, and a real LinuxCNC that cuts.

The virtual machine's heat goes faster than the world, by a factor; the controller does not.
"""

import asyncio
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from pathlib import Path

import aiomqtt
import numpy as np
from broker import Mosquitto
from driftmodels import ACCEPTED
from linuxcnclive import Live
from numpy.typing import NDArray

from thermocomp.core.correction import Limits
from thermocomp.core.model import ErrorModel
from thermocomp.core.reading import Reading
from thermocomp.files import modelfile
from thermocomp.live.adapters.plain import find_experiment
from thermocomp.models.training import train
from thermocomp.models.watching import find_watch
from thermocomp.recordings.stacking import stack
from thermocomp.runtime.compensator import Compensator
from thermocomp.virtual.datasets import record
from thermocomp.virtual.experiments import simulate

#: seed of the virtual machine, and its seconds in one of the world: others are tried by hand
SEED, FACTOR = int(os.environ.get("THERMOCOMP_SEED", "7")), float(os.environ.get("THERMOCOMP_FACTOR", "60"))
RESTARTS = int(os.environ.get("THERMOCOMP_RESTARTS", "20"))

CONFIG = """
models = ["model.json"]
state = "state.json"
speed = {factor}
own_compensation = "off"
first_start = "zero"

[limits]
magnitude = 100.0
rate = {rate}
reading_age = {age}

[[sources]]
kind = "mqtt"
topic = "mill/temperatures"
port = {port}
virtual = true

[[sinks]]
kind = "linuxcnc"
socket = "{socket}"
axes = {{z_um = "Z"}}

[journal]
file = "live.db"
"""


@cache
def model() -> ErrorModel:
    """Return a model of the virtual machine's Z, with a watch; it has seen another day than is run."""
    (day,) = record("demo")
    samples = stack([day], ["z_um"])
    samples = samples.take(np.arange(len(samples)) % 5 == 0)
    every = np.ones(len(samples), np.bool_)
    found = train("averaged", samples, 0, every).model
    return replace(found, honest_error=ACCEPTED, watch=find_watch(samples, every))


class Machine(threading.Thread):
    """The virtual machine: it publishes what its sensors say, row by row.

    Parameters
    ----------
    port : int
        Of the broker.
    factor : float
        Its seconds in one of the world.
    """

    def __init__(self, port: int, factor: float) -> None:
        super().__init__(daemon=True)
        self.port, self.factor = port, factor
        test = next(iter(simulate(find_experiment("demo", Path()), seed=SEED)))
        names = [c.name for c in test.channels]
        inputs = [k for k, c in enumerate(test.channels) if c.quantity in ("temperature", "spindle_speed")]
        self.rows = [
            json.dumps(dict(zip([names[k] for k in inputs], row, strict=True)))
            for row in test.values[:, inputs].tolist()
        ]
        z = [c.name for c in test.displacements].index("z_um")
        self.time, self.truth = test.time, np.asarray(test.truth)[:, z]
        self.row, self.begun = 0, 0.0
        self._end = threading.Event()

    def run(self) -> None:
        """Publish until it is told to end; a broker that is lost is tried again."""
        asyncio.run(self._publish())

    async def _publish(self) -> None:
        self.begun = time.monotonic()
        while not self._end.is_set():
            try:
                async with aiomqtt.Client("127.0.0.1", self.port, timeout=2.0) as client:
                    while not self._end.is_set():
                        due = self.begun + (self.time[self.row + 1] - self.time[0]) / self.factor
                        await asyncio.sleep(max(0.0, due - time.monotonic()))
                        # what was missed meanwhile is past
                        now = (time.monotonic() - self.begun) * self.factor + self.time[0]
                        self.row = int(np.searchsorted(self.time, now, side="right")) - 1
                        await client.publish("mill/temperatures", self.rows[self.row])
            except (aiomqtt.MqttError, OSError, TimeoutError):
                await asyncio.sleep(0.05)

    def end(self) -> None:
        """End."""
        self._end.set()
        self.join(10.0)

    def deviation(self) -> float:
        """Return what the tool point is off by now, uncompensated [um]."""
        now = (time.monotonic() - self.begun) * self.factor + self.time[0]
        return float(np.interp(now, self.time, self.truth))


def undisturbed(machine: Machine, at: NDArray[np.float64], rate: float) -> NDArray[np.float64]:
    """Return the corrections that a service without any disturbance would have in force at times of the world.

    Parameters
    ----------
    machine : Machine
        That was started.
    at : ndarray of shape (n,)
        On its monotone clock [s].
    rate : float
        In seconds of the world [um/s].

    Returns
    -------
    ndarray of shape (n,)
        [um]
    """
    compensator = Compensator.of([model()], Limits(magnitude=100.0, rate=rate / machine.factor, reading_age=1e6))
    state, said = compensator.start(), []
    for time_of_row, row in zip(machine.time[: machine.row + 2].tolist(), machine.rows, strict=False):
        state, told = compensator.step(state, Reading(time_of_row, json.loads(row)), time_of_row)
        said.append(told.corrections["z_um"].offset)
    now = (at - machine.begun) * machine.factor + machine.time[0]
    found: NDArray[np.float64] = np.interp(now, machine.time[: len(said)], said)
    return found


class Service:
    """`thermocomp serve`, as a process that can be killed.

    Parameters
    ----------
    folder : Path
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Start it."""
        command = [sys.executable, "-m", "thermocomp", "serve", str(self.folder / "serve.toml")]
        with (self.folder / "serve.log").open("a") as log:
            self.process = subprocess.Popen(command, stdout=log, stderr=log, env=dict(os.environ))

    def kill(self, number: int = signal.SIGKILL) -> None:
        """Kill it."""
        assert self.process is not None
        self.process.send_signal(number)
        self.process.wait(20)


class Error(threading.Thread):
    """What the tool point is off by: the machine's deviation and what the controller has in force, ten times a second.

    Parameters
    ----------
    machine : Machine
    controller : Live
    """

    def __init__(self, machine: Machine, controller: Live) -> None:
        super().__init__(daemon=True)
        self.machine, self.controller = machine, controller
        self.rows: list[tuple[float, float, float]] = []
        self._end, self.busy = threading.Event(), threading.Lock()

    def run(self) -> None:
        """Look until it is told to end."""
        while not self._end.wait(0.1):
            with self.busy:
                in_force = 1e3 * self.controller.get("axis.z.eoffset")
            self.rows.append((time.monotonic(), self.machine.deviation(), in_force))

    def end(self) -> NDArray[np.float64]:
        """Return time [s], deviation and what is in force [um], a row each."""
        self._end.set()
        self.join(10.0)
        return np.array(self.rows)


def lay_out(folder: Path, broker: Mosquitto, socket: Path, factor: float, rate: float) -> None:
    """Write model and configuration.

    Parameters
    ----------
    folder : Path
    broker : Mosquitto
    socket : Path
        Of the controller.
    factor : float
    rate : float
        In seconds of the world [um/s].
    """
    modelfile.write([model()], folder / "model.json")
    text = CONFIG.format(factor=float(factor), rate=rate / factor, age=2.0 * factor, port=broker.port, socket=socket)
    (folder / "serve.toml").write_text(text, encoding="ascii")


@contextmanager
def running(
    folder: Path, controller: Live, broker: Mosquitto, factor: float, rate: float
) -> Iterator[tuple[Service, Machine, Error]]:
    """Start a service and then the machine, on a controller that is ready, and end both and the broker after all.

    Parameters
    ----------
    folder : Path
    controller : Live
    broker : Mosquitto
        That runs.
    factor : float
    rate : float
        In seconds of the world [um/s].
    """
    lay_out(folder, broker, controller.socket, factor, rate)
    service, machine = Service(folder), Machine(broker.port, factor)
    service.start()
    controller.ready()
    try:
        time.sleep(4.0)  # the service has to be there before the machine begins, or its zero is another
        machine.start()
        deadline = time.monotonic() + 60.0
        while not (folder / "state.json").exists() and time.monotonic() < deadline:
            time.sleep(0.2)
        yield service, machine, Error(machine, controller)
    finally:
        service.kill(signal.SIGTERM)
        if machine.is_alive():
            machine.end()
        broker.kill()

#!/usr/bin/python3
"""The thermocomp component inside LinuxCNC: a HAL component that needs only Debian's Python.

``thermocomp linuxcnc setup`` copies this file next to the machine's configuration. HAL evaluates a correction at the
present position and limits its rate and magnitude in the servo thread; this process only sets the target of each line.
It may therefore die at any time: HAL continues with the last targets, and a new process starts from those in force.

The component listens on a Unix socket, reports the correction in force, and answers JSON lines:

    {"beat": 1, "axes": {"Z": [offset um, slope um/m, reference position mm]}, "magnitude": um, "rate": um/s}

All keys except ``beat`` are optional. A client that sends nothing for the timeout is disconnected; the correction is
held, then fades.
"""

import argparse
import contextlib
import json
import math
import os
import selectors
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import hal  # type: ignore[import-not-found]

NAME = "thermocomp"
#: pins of each axis: outputs and inputs of this component
TOLD = ("offset-rate", "slope-rate", "offset", "slope")
HEARD = ("offset-now", "slope-now", "away", "demand", "force")
#: interval between two checks of the controller [s]
TICK = 0.01
#: maximum number of killed components; beyond it LinuxCNC must be restarted
MOST = 200
#: maximum length of a line [bytes]; maximum number of pending connections (one is served at a time)
LONGEST, WAITING = 4096, 4
#: deviation from the demand [um] and its duration [s] beyond which the correction is reported as not following
ASIDE, PATIENCE = 1.0, 1.0
#: time without a response from the servo thread: regarded as stopped; LinuxCNC regarded as terminated [s]
STILL, GONE = 1.0, 5.0


class AxisLine:
    """An axis and the target of its correction line, in machine units relative to the middle of its travel."""

    def __init__(self, text: str, unit: float) -> None:
        letter, low, high = text.split(",")
        self.letter, self.low, self.high = letter.lower(), float(low), float(high)
        self.middle, self.half = (self.low + self.high) / 2.0, (self.high - self.low) / 2.0
        self.unit = unit  # machine units per millimetre
        self.ends: list[float] | None = None  # demanded values at both ends of the travel; None: keep those in force
        self.aside: float | None = None  # time from which the axis has not followed; None: it follows

    def demand(self, offset: float, slope: float, reference: float, magnitude: float) -> None:
        """Set the target line: offset [um], slope [um/m], reference position [mm], largest magnitude [um]."""
        wanted = (offset + 1e-3 * slope * (p / self.unit - reference) for p in (self.low, self.high))
        self.ends = [1e-3 * self.unit * max(-magnitude, min(magnitude, v)) for v in wanted]


class Server:
    """Socket server that passes received corrections to HAL."""

    def __init__(self, options: argparse.Namespace) -> None:
        self.options = options
        self.unit = 1.0 if options.unit == "mm" else 1.0 / 25.4
        self.axes = {a.letter.upper(): a for a in (AxisLine(t, self.unit) for t in options.axis)}
        self.magnitude, self.rate = options.magnitude, options.rate
        self.heard = time.monotonic()  # time of the last message; a new process grants the full timeout
        self.ticks, self.echoed = 0, time.monotonic()
        self.client: socket.socket | None = None
        self.since, self.buffer = 0.0, b""
        self.selector = selectors.DefaultSelector()
        self.pins = join(list(self.axes.values()))
        self.sent = self.pins["heartbeat"]
        self.listener = listen(options.socket, options.group)
        self.selector.register(self.listener, selectors.EVENT_READ)
        self.pins.ready()

    def run(self) -> None:
        """Serve connections and update the pins until LinuxCNC ends."""
        due = time.monotonic()
        while True:
            for key, _ in self.selector.select(max(0.0, due - time.monotonic())):
                if key.fileobj is self.listener:
                    self.accept()
                elif key.fileobj is self.client:  # the client may just have been dropped
                    self.receive()
            now = time.monotonic()
            if now >= due:
                due = max(due + TICK, now)
                self.tick(now)
            if now - self.echoed > GONE:
                return

    def get(self, axis: AxisLine, pin: str) -> float:
        """Return the value of a pin of an axis."""
        return float(self.pins[f"{axis.letter}.{pin}"])

    # -- the controller ------------------------------------------------------------------------------------------------

    def tick(self, now: float) -> None:
        """Check the controller, and output the line targets and rates."""
        if self.pins["beat"] == self.sent:
            self.echoed, self.sent = now, not self.sent
            self.pins["heartbeat"] = self.sent
        self.ticks += 1
        silent = now - self.heard
        alive = silent <= self.options.timeout
        self.pins["alive"] = alive
        if now - max(self.heard, self.since) > self.options.timeout:
            self.drop()
        fading = silent > self.options.timeout + self.options.hold
        for axis in self.axes.values():
            self.move(axis, fading)
            aside = abs(self.get(axis, "demand") - self.get(axis, "force"))
            follows = aside <= ASIDE * 1e-3 * self.unit
            axis.aside = None if follows else axis.aside or now

    def move(self, axis: AxisLine, fading: bool) -> None:
        """Move the correction line of an axis to its target without bending it, both ends within the rate limit."""
        if fading:
            axis.ends = None
        elif axis.ends is None:
            return
        most, micron = self.magnitude * 1e-3 * self.unit, 1e-3 * self.unit
        low, high = (max(-most, min(most, v)) for v in axis.ends or (0.0, 0.0))
        offset, slope = (low + high) / 2.0, (high - low) / (2.0 * axis.half)
        rate = micron * (min(self.rate, self.options.fade) if fading else self.rate)
        begin = self.get(axis, "offset-now"), self.get(axis, "slope-now")
        if begin == (offset, slope):  # target reached: use the rate for returning from zero after off and on
            begin = 0.0, 0.0
        steps = abs(offset - begin[0]), abs(slope - begin[1])
        seconds = (steps[0] + steps[1] * axis.half) / rate or 1.0  # for the end of the travel that moves further
        letter = axis.letter  # the servo thread may interrupt: zero rates prevent a wrong movement
        self.pins[f"{letter}.offset-rate"] = self.pins[f"{letter}.slope-rate"] = 0.0
        self.pins[f"{letter}.offset"], self.pins[f"{letter}.slope"] = offset, slope
        self.pins[f"{letter}.offset-rate"], self.pins[f"{letter}.slope-rate"] = (v / seconds for v in steps)

    def why(self) -> str:
        """Return the reason why no correction can be in force; empty if one can."""
        if self.pins["on"]:
            return ""
        if not self.pins["homed"]:
            return "not homed"
        return "in joint mode" if self.pins["enabled"] else "off"

    def report(self, beat: int) -> dict[str, Any]:
        """Return the report of the correction in force, in answer to a message."""
        now = time.monotonic()
        why, limited = self.why(), self.pins["limited"]
        micron = 1e-3 * self.unit
        axes = {}
        for letter, axis in self.axes.items():
            alarm = ""
            if not why and axis.aside is not None and now - axis.aside > PATIENCE:
                alarm = (
                    "clipped at a soft limit"
                    if limited
                    else "does not follow: check that OFFSET_AV_RATIO is in the INI file"
                )
            share = 0.0 if why else 1.0  # LinuxCNC continues to show an offset that is now part of the position
            axes[letter] = {
                "offset": share * self.get(axis, "offset-now") / micron,
                "slope": share * self.get(axis, "slope-now") * 1e6,
                "reference": axis.middle / self.unit,
                "position": (self.get(axis, "away") + axis.middle) / self.unit,
                "demand": share * self.get(axis, "demand") / micron,
                "in_force": share * self.get(axis, "force") / micron,
                "alarm": alarm,
            }
        known = {"beat": beat, "ticks": self.ticks, "timeout": self.options.timeout}
        still = now - self.echoed > STILL  # the correction in force is then the last known one
        return {**known, "suspended": why, "still": still, "limited": limited, "axes": axes}

    # -- the service ---------------------------------------------------------------------------------------------------

    def accept(self) -> None:
        """Accept a connection of the service; if another service is connected, report this and close."""
        connection, _ = self.listener.accept()
        if self.client is not None and self.left():
            self.drop()
        greeting = {"error": "another service is connected"} if self.client is not None else self.report(0)
        with contextlib.suppress(OSError):
            connection.sendall(json.dumps(greeting).encode() + b"\n")
        if self.client is not None:
            connection.close()
            return
        connection.setblocking(False)
        self.client, self.buffer = connection, b""
        self.selector.register(connection, selectors.EVENT_READ)
        self.since = time.monotonic()

    def left(self) -> bool:
        """Return whether the connected service has disconnected; checked only when another one connects."""
        assert self.client is not None
        try:
            return self.client.recv(1, socket.MSG_PEEK) == b""
        except BlockingIOError:
            return False
        except OSError:
            return True

    def drop(self) -> None:
        """Close the connection to the service."""
        if self.client is not None:
            self.selector.unregister(self.client)
            self.client.close()
            self.client = None

    def receive(self) -> None:
        """Receive messages from the service and answer each."""
        client = self.client
        assert client is not None
        try:
            found = client.recv(65536)
            if not found:
                raise ConnectionError
            *lines, self.buffer = (self.buffer + found).split(b"\n")
            if max(map(len, [*lines, self.buffer])) > LONGEST:
                raise ConnectionError
            for line in lines:
                try:
                    answer = self.take(json.loads(line))
                except (ValueError, TypeError, KeyError, AttributeError, RecursionError, OverflowError) as e:
                    answer = {"error": f"not understood: {type(e).__name__}: {e}"[:200]}
                client.sendall(json.dumps(answer).encode() + b"\n")
        except OSError:  # disconnected, or not reading the answers
            self.drop()

    def take(self, message: dict[str, Any]) -> dict[str, Any]:
        """Apply a message of the service completely, or reject it."""
        limits = {}
        for name in ("magnitude", "rate"):
            value = float(message.get(name, getattr(self.options, name)))
            if not 0.0 < value < math.inf:
                raise ValueError(f"{name} = {value}: expected a positive finite number")
            limits[name] = min(value, getattr(self.options, name))
        lines = {letter: [float(v) for v in line] for letter, line in message.get("axes", {}).items()}
        for letter, line in lines.items():
            if letter not in self.axes:
                raise ValueError(f"axis {letter} is not corrected here, only {', '.join(self.axes)}")
            if len(line) != 3 or not all(map(math.isfinite, line)):
                raise ValueError(
                    f"axis {letter}: {line}: expected three finite numbers (offset, slope, reference position)"
                )
        beat = int(message["beat"])
        self.heard = time.monotonic()
        self.magnitude, self.rate = limits["magnitude"], limits["rate"]
        for letter, (offset, slope, reference) in lines.items():
            self.axes[letter].demand(offset, slope, reference, self.magnitude)
            self.move(self.axes[letter], False)  # immediately, not at the next tick
        return self.report(beat)


def named(k: int) -> str:
    """Return the component name to use after `k` components were killed."""
    return f"{NAME}-{k}" if k else NAME


def join(axes: list[AxisLine]) -> Any:
    """Return a component whose pins are linked to the signals of ``thermocomp.hal``; this moves nothing.

    Pins are read and written without HAL's lock: a process that is killed while holding the lock stops LinuxCNC.
    """
    for k in range(MOST + 1):
        try:
            component = hal.component(named(k))
            break
        except hal.error:  # left by a killed component: its name and pins remain
            if k == MOST:
                raise
    hal.set_msg_level(hal.MSG_NONE)
    told = {"heartbeat": hal.HAL_BIT, "alive": hal.HAL_BIT}
    heard = dict.fromkeys(("beat", "on", "homed", "enabled", "limited"), hal.HAL_BIT)
    for axis in axes:
        told |= dict.fromkeys((f"{axis.letter}.{part}" for part in TOLD), hal.HAL_FLOAT)
        heard |= dict.fromkeys((f"{axis.letter}.{part}" for part in HEARD), hal.HAL_FLOAT)
    for pins, way in ((heard, hal.HAL_IN), (told, hal.HAL_OUT)):
        for pin, kind in pins.items():
            component.newpin(pin, kind, way)
            signal_name = f"tc-{pin.replace('.', '-')}"
            if way == hal.HAL_OUT:
                part = pin.rpartition(".")[2]
                now = pin if part in ("heartbeat", "alive") else f"{pin}-now"
                if part.endswith("-rate"):
                    component[pin] = 0.0
                else:
                    component[pin] = hal.get_value(f"tc-{now.replace('.', '-')}")
                for killed in range(k):  # a signal accepts one writer only
                    with contextlib.suppress(hal.error, RuntimeError):
                        hal.disconnect(f"{named(killed)}.{pin}")
            hal.connect(f"{named(k)}.{pin}", signal_name)
    hal.set_msg_level(hal.MSG_ERR)
    return component


def listen(path: str, group: str) -> socket.socket:
    """Return a listening socket, accessible to this user and to the members of the group, if one is named."""
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    with contextlib.suppress(FileNotFoundError):  # left by a killed process
        Path(path).unlink()
    before = os.umask(0o177)
    try:
        listener.bind(path)
    finally:
        os.umask(before)
    if group:
        shutil.chown(path, group=group)
        Path(path).chmod(0o660)
    listener.listen(WAITING)
    return listener


def ending(child: "subprocess.Popen[bytes]") -> Callable[..., None]:
    """Return a signal handler that terminates the child process."""
    return lambda *_: child.terminate()


def keep(arguments: list[str]) -> None:
    """Run the component in a separate process, and restart it whenever it dies."""
    here = Path(__file__).resolve()
    while here.exists():
        child = subprocess.Popen([sys.executable, str(here), *arguments, "--once"])
        signal.signal(signal.SIGTERM, ending(child))
        if child.wait() in (0, -signal.SIGTERM):
            return
        time.sleep(0.2)


def main() -> None:
    """Parse the arguments and run the component."""
    parser = argparse.ArgumentParser(description="The thermocomp component inside LinuxCNC.")
    parser.add_argument("--pattern", choices=("offset", "drive"), required=True)
    parser.add_argument("--axis", action="append", required=True, help="letter,low,high: z,-200,100 [units of the INI]")
    parser.add_argument("--socket", required=True)
    parser.add_argument("--group", default="", help="user group whose members may connect")
    parser.add_argument("--unit", choices=("mm", "inch"), default="mm")
    for name, unit in (("magnitude", "um"), ("rate", "um/s"), ("timeout", "s"), ("hold", "s"), ("fade", "um/s")):
        parser.add_argument(f"--{name}", type=float, required=True, help=unit)
    parser.add_argument("--once", action="store_true", help="do not restart the component if it is killed")
    options = parser.parse_args()
    if not options.once:
        keep(sys.argv[1:])
        return
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))  # LinuxCNC terminates
    try:
        server = Server(options)
    except (hal.error, RuntimeError) as e:  # a restart would fail again
        print(f"thermocomp: {e}: LinuxCNC is not running with thermocomp.hal", file=sys.stderr)
        return
    server.run()


if __name__ == "__main__":
    main()

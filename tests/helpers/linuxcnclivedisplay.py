"""Does in a LinuxCNC what a test asks for: executed by it as its user interface, with the system's Python.

Requests and answers are JSON lines on a Unix socket; LinuxCNC ends when this ends.
"""

import json
import socket
import subprocess
import time

import hal  # type: ignore[import-not-found]
import linuxcnc  # type: ignore[import-not-found]

status, command, errors = linuxcnc.stat(), linuxcnc.command(), linuxcnc.error_channel()
component = hal.component("testdisplay")
component.ready()
tracer: "subprocess.Popen[bytes] | None" = None


def wait(until: "object", seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while True:
        status.poll()
        if until():  # type: ignore[operator]
            return
        if time.monotonic() > end:
            raise RuntimeError(f"takes too long; {errors.poll()}")
        time.sleep(0.005)


def idle() -> bool:
    return bool(status.interp_state == linuxcnc.INTERP_IDLE and status.inpos and not status.queue)


def on() -> None:
    command.state(linuxcnc.STATE_ESTOP_RESET)
    wait(lambda: status.task_state != linuxcnc.STATE_ESTOP)
    command.state(linuxcnc.STATE_ON)
    wait(lambda: status.task_state == linuxcnc.STATE_ON)


def off() -> None:
    command.state(linuxcnc.STATE_OFF)
    wait(lambda: status.task_state != linuxcnc.STATE_ON)


def home() -> None:
    command.mode(linuxcnc.MODE_MANUAL)
    command.wait_complete()
    command.teleop_enable(0)
    command.wait_complete()
    command.home(-1)
    wait(lambda: all(status.homed[: status.joints]))
    teleop(1)


def teleop(wanted: int) -> None:
    command.mode(linuxcnc.MODE_MANUAL)
    command.wait_complete()
    command.teleop_enable(wanted)
    command.wait_complete()


def mode(wanted: int) -> None:
    """Change the mode; a computer that stood still has lost the command, so it is said again."""
    for _ in range(5):
        command.mode(wanted)
        command.wait_complete()
        status.poll()
        if status.task_mode == wanted:
            return
        time.sleep(0.5)
    raise RuntimeError(f"does not change its mode; {errors.poll()}")


def mdi(text: str) -> None:
    mode(linuxcnc.MODE_MDI)
    command.mdi(text)
    command.wait_complete()
    wait(idle)


def start(program: str) -> None:
    mode(linuxcnc.MODE_AUTO)
    command.program_open(program)
    command.wait_complete()
    command.auto(linuxcnc.AUTO_RUN, 0)
    wait(lambda: status.interp_state != linuxcnc.INTERP_IDLE)


def probe(text: str) -> float:
    """Probe along Z, and return where it touched, as #5063 has it."""
    mdi(text)
    status.poll()
    return float(status.probed_position[2])


def ended() -> None:
    wait(idle, 900.0)


def running() -> bool:
    status.poll()
    return not idle()


def halcmd(*words: str) -> str:
    with open("halcmd.out", "w+", encoding="utf-8") as out:  # noqa: PTH123 - what it starts keeps a pipe open
        subprocess.run(["halcmd", *words], check=True, stdout=out)
        out.seek(0)
        return out.read()


def get(*names: str) -> "list[object]":
    return [hal.get_value(name) for name in names]


def told() -> "list[str]":
    found = []
    while (one := errors.poll()) is not None:
        found.append(str(one[1]))
    return found


def trace(file: str) -> None:
    global tracer  # noqa: PLW0603
    tracer = subprocess.Popen(["halsampler", "-t", file])
    hal.set_p("sampler.0.enable", "1")


def stop() -> None:
    assert tracer is not None
    hal.set_p("sampler.0.enable", "0")
    time.sleep(0.2)  # what is left is written
    tracer.terminate()
    tracer.wait()


def main() -> None:
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind("display.sock")
        listener.listen(1)
        connection, _ = listener.accept()
        with connection, connection.makefile("rw") as file:
            for line in file:
                name, *arguments = json.loads(line)
                try:
                    answer = [globals()[name](*arguments), None]
                except Exception as e:  # noqa: BLE001
                    answer = [None, repr(e)]
                file.write(json.dumps(answer) + "\n")
                file.flush()


main()

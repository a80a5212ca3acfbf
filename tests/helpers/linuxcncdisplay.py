"""Runs NC programs in a LinuxCNC without a display: executed by it as its user interface, with the system's Python.

Arguments: the seconds it may take, and the programs. LinuxCNC ends when this ends.
"""

import subprocess
import sys
import time

import linuxcnc  # type: ignore[import-not-found]

END = time.monotonic() + float(sys.argv[1])
SETTLED = "G21 G17 G90 G94 G64 G80 G40 G49 G54 G53 G0 X0 Y0 Z0"
TURNED = " A0"


def main() -> None:
    status, command, errors = linuxcnc.stat(), linuxcnc.command(), linuxcnc.error_channel()

    def wait(what: str, until: "object") -> None:
        while True:
            status.poll()
            told = errors.poll()
            if told:
                raise RuntimeError(f"{what}: {told}")
            if until():  # type: ignore[operator]
                return
            if time.monotonic() > END:
                raise RuntimeError(f"{what}: takes too long")
            time.sleep(0.005)

    def idle() -> bool:
        return bool(status.interp_state == linuxcnc.INTERP_IDLE and status.inpos and not status.queue)

    def mark(number: int) -> None:
        subprocess.run(["halcmd", "sets", "program", str(number)], check=True)

    command.state(linuxcnc.STATE_ESTOP_RESET)
    wait("reset", lambda: status.task_state == linuxcnc.STATE_ESTOP_RESET)
    command.state(linuxcnc.STATE_ON)
    wait("on", lambda: status.task_state == linuxcnc.STATE_ON)
    command.home(-1)
    wait("homing", lambda: all(status.homed[: status.joints]))
    command.teleop_enable(1)
    command.wait_complete()
    with open("samples.txt", "w", encoding="ascii") as out:  # noqa: PTH123
        sampler = subprocess.Popen(["halsampler", "-t"], stdout=out)
        try:
            for number, program in enumerate(sys.argv[2:], 1):
                command.mode(linuxcnc.MODE_MDI)
                command.wait_complete()
                command.mdi(SETTLED + (TURNED if status.joints > 3 else ""))
                command.wait_complete()
                wait("settling", idle)
                command.mode(linuxcnc.MODE_AUTO)
                command.wait_complete()
                command.program_open(program)
                command.wait_complete()
                time.sleep(0.05)
                mark(number)
                command.auto(linuxcnc.AUTO_RUN, 0)
                wait(f"{program} starts", lambda: status.interp_state != linuxcnc.INTERP_IDLE)
                wait(program, idle)
                time.sleep(0.05)
                mark(0)
            time.sleep(0.3)  # the sampler writes what is left
        finally:
            sampler.terminate()
            sampler.wait()


try:
    main()
except Exception as e:  # noqa: BLE001
    print(f"FAILED: {e!r}", file=sys.stderr, flush=True)
else:
    print("DONE", file=sys.stderr, flush=True)

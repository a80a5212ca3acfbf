"""The command line's door: one app, one place where errors become messages and exit codes."""

import sys
import time
import traceback
from collections.abc import Sequence

from cyclopts import App, Parameter

from thermocomp import __version__
from thermocomp.cli import jsonoutput, loudness
from thermocomp.cli.exits import FAULT, STDIN, STOPPED
from thermocomp.cli.extras import needs
from thermocomp.cli.terminal import make_console, words
from thermocomp.core.exceptions import ThermocompError

app = App(
    name="thermocomp",
    help="Thermal error compensation of machine tools: from temperature recordings to a validated model.",
    version=__version__,
    version_flags=["--version", "-V"],
    # every command returns its exit code; nothing but `main` leaves the process
    result_action="return_value",
    suppress_keyboard_interrupt=False,
    # a flag is set or not, and an option takes all words up to the next one
    default_parameter=Parameter(negative=(), consume_multiple=True),
)

#: a file each; it is read when its command is called, so this line of its docstring stands here too (a test compares)
COMMANDS = {
    "demo": "Do the main job on the virtual machine: record, fit, judge on unseen cycles, report.",
    "simulate": "Record an experiment on a virtual machine.",
    "check": "Tell what recordings hold and what is wrong with them; of more than three files, a line each.",
    "map": "Write how a logger's file is to be read and cleaned, asking what cannot be seen.",
    "select": "Choose the few temperature sensors that a model needs.",
    "fit": "Fit a model, judge it on thermal cycles it has not seen, and write it with its honest error.",
    "explain": "Say what the models of a file are made of, how good they are, and what a failure of each sensor does.",
    "assess": "Judge a model file on recordings: per cycle, with noise, with each sensor lost, outside its range.",
    "compare": "Compare methods on thermal cycles they have not seen, beside no compensation.",
    "plan": "Say how much test is enough, and write the test that would teach most next as an NC program.",
    "position": "Fit position-dependent errors: cold profiles and thermal slopes, judged on what they have not seen.",
    "iso230": "Evaluate thermal tests after ISO 230-3 and positioning tests after ISO 230-2, and the time constants of "
    "channels.",
    "volumetric": "Tell the error of the tool's tip at a point and all over the work volume, and what corrections "
    "leave of it.",
    "revise": "Correct an NC program by the drift it will cause, before it is run.",
    "export": "Write the models of a file as code for another controller, with test vectors and how to use it.",
    "serve": "Run the compensator live: sensors in, corrections out, with a page to watch.",
    "journal": "Tell what a journal of the live compensator holds, or export it as a recording.",
    "linuxcnc": "Write what a LinuxCNC needs to be corrected, and say what to change in its configuration.",
    "papers": "Redo the papers' studies on the virtual machine: their number, ours, and whether their claim holds "
    "here.",
}
for command, summary in COMMANDS.items():
    app.command(f"thermocomp.cli.{command}:{command}", name=command, help=summary)
for flag, summary in loudness.FLAGS.items():  # for the help: `run` takes them off before anything is looked up
    app.command(lambda: None, name=flag, help=summary)
app.register_install_completion_command()


def run(arguments: Sequence[str] | None = None) -> int:
    """Run one command line.

    Parameters
    ----------
    arguments : sequence of str, optional
        ``sys.argv[1:]`` if not given.

    Returns
    -------
    int
        0 done, 1 judged bad, 2 unusable input, 3 a fault of the program, 130 stopped by the keyboard.
    """
    given = sys.argv[1:] if arguments is None else list(arguments)
    jsonoutput.called_with = given
    begin = time.perf_counter()
    try:
        line = loudness.taken_off(given)
        with needs("study"):
            code = app([str(STDIN) if word == "-" else word for word in line], error_console=make_console(stderr=True))
        loudness.tell(f"took {time.perf_counter() - begin:.1f} s")
    except ThermocompError as e:
        return _unusable(str(e), getattr(e, "__notes__", ()))
    except OSError as e:  # a folder that may not be written to, a full disk
        return _unusable(f"{e.filename or ''}: {e.strerror or e}".removeprefix(": "))
    except SystemExit as e:
        if e.code and e.__context__ is not None:  # words that no command takes: it was told on stderr
            _tell_programs(str(e.__context__))
        raise
    except KeyboardInterrupt:
        make_console(stderr=True).print("[bold red]stopped:[/] nothing was finished, nothing was written")
        return STOPPED
    except Exception as e:  # noqa: BLE001 - a user is told what happened, and how to see where
        return _fault(e)
    return code if isinstance(code, int) else 0


def main() -> None:
    """Entry point of the ``thermocomp`` command."""
    sys.exit(run())


def _unusable(message: str, notes: Sequence[str] = ()) -> int:
    text = "\n".join(words(line) for line in "\n".join((message, *notes)).split("\n"))
    make_console(stderr=True).print(f"[bold red]error:[/] {text}", soft_wrap=True)
    _tell_programs(message, notes)
    return 2


def _fault(error: Exception) -> int:
    if loudness.verbose:
        traceback.print_exception(error)
    message = f"unexpected: {type(error).__name__}: {error}"
    hint = "" if loudness.verbose else "; this is a fault of thermocomp: --verbose tells where, for a report"
    make_console(stderr=True).print(f"[bold red]error:[/] {words(message + hint)}", soft_wrap=True)
    _tell_programs(message)
    return FAULT


def _tell_programs(message: str, notes: Sequence[str] = ()) -> None:
    if "--json" in jsonoutput.called_with:
        jsonoutput.print_json({"error": message, **({"notes": list(notes)} if notes else {})})


if __name__ == "__main__":
    main()

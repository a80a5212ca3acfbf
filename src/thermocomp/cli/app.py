"""Entry point of the command line: the app, and the conversion of errors to messages and exit codes."""

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
from thermocomp.core.plugins import describe_plugin, find_plugins, read_summary

app = App(
    name="thermocomp",
    help="Thermal error compensation of machine tools: from temperature recordings to a validated model.",
    version=__version__,
    version_flags=["--version", "-V"],
    # every command returns its exit code; only `main` exits the process
    result_action="return_value",
    suppress_keyboard_interrupt=False,
    # flags have no negative form, and an option takes all words up to the next option
    default_parameter=Parameter(negative=(), consume_multiple=True),
)


def _skip(message: str) -> None:
    make_console(stderr=True).print(f"[bold yellow]trouble[/] {words(message)}", soft_wrap=True)


#: commands by name; a command is imported when it is called
COMMANDS = find_plugins("commands", _skip)
for command, entry in COMMANDS.items():
    if (summary := read_summary(entry)) is None:
        _skip(f"{describe_plugin(entry)} is skipped: {entry.value} does not exist")
    else:
        app.command(entry.value, name=command, help=summary)
for flag, summary in loudness.FLAGS.items():  # for the help only: `run` removes them before the command is parsed
    app.command(lambda: None, name=flag, help=summary)
app.register_install_completion_command()


def run(arguments: Sequence[str] | None = None) -> int:
    """Run one command line.

    Parameters
    ----------
    arguments : sequence of str, optional
        Command-line words. Default: ``sys.argv[1:]``.

    Returns
    -------
    int
        0 done, 1 judged bad, 2 unusable input, 3 internal error, 130 interrupted from the keyboard.
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
    except OSError as e:  # directory not writable, disk full
        return _unusable(f"{e.filename or ''}: {e.strerror or e}".removeprefix(": "))
    except SystemExit as e:
        if e.code and e.__context__ is not None:  # words that no command accepts: already reported on stderr
            _tell_programs(str(e.__context__))
        raise
    except KeyboardInterrupt:
        make_console(stderr=True).print("[bold red]stopped:[/] nothing was finished, nothing was written")
        return STOPPED
    except Exception as e:  # noqa: BLE001 - the user gets a message, and a hint for the traceback
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
    hint = (
        ""
        if loudness.verbose
        else "; this is a fault of thermocomp: run it again with --verbose and report the traceback"
    )
    make_console(stderr=True).print(f"[bold red]error:[/] {words(message + hint)}", soft_wrap=True)
    _tell_programs(message)
    return FAULT


def _tell_programs(message: str, notes: Sequence[str] = ()) -> None:
    if "--json" in jsonoutput.called_with:
        jsonoutput.print_json({"error": message, **({"notes": list(notes)} if notes else {})})


if __name__ == "__main__":
    main()

"""The command line's door: one app, one place where errors become messages and exit codes."""

import sys
from collections.abc import Sequence

from cyclopts import App
from rich.console import Console
from rich.markup import escape

from thermocomp import __version__
from thermocomp.cli import commands
from thermocomp.cli.iso230 import iso230
from thermocomp.cli.papers import papers
from thermocomp.cli.position import position
from thermocomp.cli.revise import revise
from thermocomp.cli.shown import shown
from thermocomp.cli.volumetric import volumetric
from thermocomp.core.exceptions import ThermocompError

app = App(
    name="thermocomp",
    help="Thermal error compensation of machine tools: from temperature recordings to a validated model.",
    version=__version__,
    # every command returns its exit code; nothing but `main` leaves the process
    result_action="return_value",
    suppress_keyboard_interrupt=False,
)

for command in (
    commands.demo,
    commands.simulate,
    commands.check,
    commands.select,
    commands.fit,
    commands.assess,
    commands.compare,
    position,
    iso230,
    volumetric,
    revise,
    papers,
):
    app.command(command)


def run(arguments: Sequence[str] | None = None) -> int:
    """Run one command line.

    Parameters
    ----------
    arguments : sequence of str, optional
        ``sys.argv[1:]`` if not given.

    Returns
    -------
    int
        0 done, 1 judged bad, 2 unusable input, 130 stopped by the keyboard.
    """
    try:
        code = app(None if arguments is None else list(arguments))
    except ThermocompError as e:
        return _unusable(str(e))
    except OSError as e:  # a folder that may not be written to, a full disk
        return _unusable(f"{e.filename or ''}: {e.strerror or e}".removeprefix(": "))
    except KeyboardInterrupt:
        Console(stderr=True, highlight=False).print("[bold red]stopped:[/] nothing was finished, nothing was written")
        return commands.STOPPED
    return code if isinstance(code, int) else 0


def main() -> None:
    """Entry point of the ``thermocomp`` command."""
    sys.exit(run())


def _unusable(message: str) -> int:
    text = "\n".join(shown(line) for line in message.split("\n"))
    Console(stderr=True, highlight=False).print(f"[bold red]error:[/] {escape(text)}", soft_wrap=True)
    return 2


if __name__ == "__main__":
    main()

"""Directive ``cli-help``: the help text of a command, printed by the program at build time.

    .. cli-help:: fit

Without a name: the help text of the whole program.
"""

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar

from docutils import nodes
from sphinx.util.docutils import SphinxDirective

from thermocomp.cli import app

COLUMNS = 104


def printed(arguments: Sequence[str], folder: Path | None = None) -> str:
    """Run the program on a plain terminal of a fixed width and return what it prints.

    Raises
    ------
    RuntimeError
        It did not end with exit code 0.
    """
    line = [sys.executable, "-m", "thermocomp.cli.app", *arguments]
    terminal = {"COLUMNS": str(COLUMNS), "NO_COLOR": "1", "TERM": "dumb", "PYTHONIOENCODING": "utf-8"}
    done = subprocess.run(
        line, cwd=folder, env=os.environ | terminal, capture_output=True, encoding="utf-8", check=False
    )
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(line[1:])} ended with {done.returncode}: {done.stderr.strip()}")
    return "\n".join(row.rstrip() for row in done.stdout.strip().splitlines())


class CliHelp(SphinxDirective):
    """See the module."""

    optional_arguments: ClassVar[int] = 1

    def run(self) -> list[nodes.Node]:
        """Return the help as a literal block."""
        self.env.note_dependency(str(app.__file__))
        try:
            text = printed([*self.arguments, "--help"])
        except RuntimeError as e:
            raise self.error(str(e)) from e
        block = nodes.literal_block(text, text, language="none", classes=["cli-help"])
        self.set_source_info(block)
        return [block]


def setup(app: Any) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("cli-help", CliHelp)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

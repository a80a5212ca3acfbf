"""Directive ``cli-run``: a command line and what it prints, run among copies of ``docs/files`` when the page is built.

    .. cli-run:: volumetric mill.toml --at 500 450 100

The command lines of a page share a folder: one may read what another has written.
"""

import shlex
import shutil
import tempfile
from pathlib import Path
from typing import Any, ClassVar

from cli_help import printed
from docutils import nodes
from sphinx.util.docutils import SphinxDirective


class CliRun(SphinxDirective):
    """See the module."""

    required_arguments: ClassVar[int] = 1
    final_argument_whitespace: ClassVar[bool] = True

    def run(self) -> list[nodes.Node]:
        """Return the command line and its output as a literal block."""
        (line,) = self.arguments
        try:
            text = f"$ thermocomp {line}\n{printed(shlex.split(line), self._folder())}"
        except RuntimeError as e:
            raise self.error(str(e)) from e
        block = nodes.literal_block(text, text, language="none", classes=["cli-help"])
        self.set_source_info(block)
        self.env.note_reread()  # the program may print something else the next time
        return [block]

    def _folder(self) -> Path:
        """Return the page's folder; it goes when the page has been read."""
        if "cli_run" not in self.env.temp_data:
            folder = self.env.temp_data["cli_run"] = tempfile.TemporaryDirectory()
            shutil.copytree(Path(self.env.srcdir) / "files", folder.name, dirs_exist_ok=True)
        return Path(self.env.temp_data["cli_run"].name)


def setup(app: Any) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("cli-run", CliRun)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

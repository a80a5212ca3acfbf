"""Pages as PDF, printed by a browser of the Chromium family, which is on almost every computer."""

import os
import subprocess
import tempfile
from pathlib import Path

from thermocomp.core.browsers import find_browser
from thermocomp.core.exceptions import InputError
from thermocomp.files.draft import draft

PATIENCE = 120.0
#: on paper, the pictures of a page stay; nothing in a page may run
NO_SCRIPTS = """<head><meta http-equiv="Content-Security-Policy" content="script-src 'none'">"""


def write_pdf(page: str, target: Path, *, overwrite: bool) -> Path:
    """Print a page to a PDF file and return its path.

    Raises
    ------
    InputError
        There is no browser, or it printed nothing.
    """
    browser = find_browser()
    with draft(target, overwrite=overwrite) as path, tempfile.TemporaryDirectory(dir=path.parent) as folder:
        source, made = Path(folder, "page.html").resolve(), Path(folder, "page.pdf").resolve()
        source.write_text(page.replace("<head>", NO_SCRIPTS, 1), encoding="utf-8")
        options = ["--headless", "--disable-gpu", "--no-first-run", "--no-pdf-header-footer"]
        if hasattr(os, "geteuid") and os.geteuid() == 0:
            options.append("--no-sandbox")  # with it, the browser refuses to run as root
        words = [browser, *options, f"--user-data-dir={folder}/profile", f"--print-to-pdf={made}", source.as_uri()]
        try:
            done = subprocess.run(words, capture_output=True, timeout=PATIENCE, check=False)
            why = done.stderr.decode(errors="replace").strip().rpartition("\n")[2]
        except (OSError, subprocess.TimeoutExpired) as e:
            why = str(e)
        if not made.is_file() or not made.read_bytes().startswith(b"%PDF"):
            raise InputError(f"{target}: {browser} printed no PDF ({why}); write .html and print it from a browser")
        path.write_bytes(made.read_bytes())
    return target

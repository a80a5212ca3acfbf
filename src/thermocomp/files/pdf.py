"""Pages as PDF, printed by a browser of the Chromium family, which is on almost every computer."""

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from thermocomp.core.exceptions import InputError
from thermocomp.files.draft import draft

#: names in the search path, then usual places of Windows and macOS
BROWSERS = (
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
    "microsoft-edge",
    "chrome",
    "msedge",
    r"C:\Program Files (x86)\Microsoft\Edge\Application\msedge.exe",
    r"C:\Program Files\Google\Chrome\Application\chrome.exe",
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
    "/Applications/Microsoft Edge.app/Contents/MacOS/Microsoft Edge",
)
PATIENCE = 120.0
#: on paper, the pictures of a page stay; nothing in a page may run
NO_SCRIPTS = """<head><meta http-equiv="Content-Security-Policy" content="script-src 'none'">"""


def find_browser() -> str:
    """Return the path of the browser that prints.

    Raises
    ------
    InputError
        None was found.
    """
    if found := next(filter(None, map(shutil.which, BROWSERS)), None):
        return found
    raise InputError(
        "a PDF is printed by Chromium, Chrome or Edge, none of which was found; install one, or write .html instead"
    )


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

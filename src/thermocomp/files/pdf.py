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
NO_SCRIPTS = """<meta http-equiv="Content-Security-Policy" content="script-src 'none'">"""


def write_pdf(page: str, target: Path, *, overwrite: bool) -> Path:
    """Print a page to a PDF file and return its path.

    Raises
    ------
    InputError
        There is no browser, or it did not print the whole page.
    """
    browser = find_browser()
    before, head, after = page.partition("<head>")
    assert head, "without a head, scripts of the page could run"
    with draft(target, overwrite=overwrite) as path, tempfile.TemporaryDirectory(dir=path.parent) as folder:
        source, made = Path(folder, "page.html").resolve(), Path(folder, "page.pdf").resolve()
        source.write_text(f"{before}{head}{NO_SCRIPTS}{after}", encoding="utf-8")
        options = ["--headless", "--disable-gpu", "--no-first-run", "--no-pdf-header-footer"]
        if hasattr(os, "geteuid") and os.geteuid() == 0:
            options.append("--no-sandbox")  # root is refused otherwise
        words = [browser, *options, f"--user-data-dir={folder}/profile", f"--print-to-pdf={made}", source.as_uri()]
        content, why = b"", ""
        try:
            done = subprocess.run(words, capture_output=True, timeout=PATIENCE, check=False)
            why = done.stderr.decode(errors="replace").strip().rpartition("\n")[2]
            if done.returncode == 0 and made.is_file():
                content = made.read_bytes()
        except (OSError, subprocess.TimeoutExpired) as e:
            why = str(e)
        if not (content.startswith(b"%PDF") and content.rstrip().endswith(b"%%EOF")):
            raise InputError(f"{target}: {browser} printed no PDF ({why}); write .html and print it from a browser")
        path.write_bytes(content)
    return target

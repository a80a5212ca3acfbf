"""Browsers that print pages: those of the Chromium family."""

import shutil

from thermocomp.core.exceptions import InputError

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

"""`thermocomp app`: a page to work in, from the logger's file to a model for a controller."""

import asyncio
import contextlib
import webbrowser
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from thermocomp.cli.extras import needs
from thermocomp.cli.terminal import console, words


def app(project: Path, /, *, port: int = 0, browser: Annotated[bool, Parameter(negative="--no-browser")] = True) -> int:
    """Open the page of a project in the browser: drop recordings, judge methods, export models.

    Everything is stored in the project's folder; ``thermocomp run`` does the same work without a page. The page is only
    reachable from this computer, under an address that contains a secret. Runs go on when the page or this command is
    closed.

    Parameters
    ----------
    project : Path
        Folder of the project, created if missing.
    port : int
        Port of the page; 0: any free one.
    browser : bool
        Open the page in the browser.

    Returns
    -------
    int
        0 stopped, 2 unusable input.
    """
    with needs("app"):
        from thermocomp.app.store import Store
        from thermocomp.app.web import make_app
        from thermocomp.live.page.web import listen, serve
    store = Store(project.parent if project.name == "project.toml" else project)
    made = make_app(store)
    listening = listen("127.0.0.1", port)
    address = f"http://127.0.0.1:{listening.getsockname()[1]}/{made.state.token}/"
    console.print(words(f"Page of the project {store.folder}:"), soft_wrap=True)
    console.print(words(address), soft_wrap=True)
    console.print("Ctrl-C closes the page; what is running goes on.", soft_wrap=True)
    if browser:
        webbrowser.open(address)
    with contextlib.suppress(KeyboardInterrupt):
        asyncio.run(serve(made, listening))
    return 0

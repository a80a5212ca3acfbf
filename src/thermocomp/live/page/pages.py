"""Interface of a page of the service: a router named by an entry point of ``thermocomp.pages``."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import jinja2
from fastapi import APIRouter, Depends, params
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer

from thermocomp.live.loop import Service
from thermocomp.live.page.doors import Doorkeeper

_FOLDER = Path(__file__).parent / "templates"


@dataclass(frozen=True)
class Board:
    """Data that a page shows, and commands that it may give.

    Parameters
    ----------
    service : Service
        The service, with the state and the events of its compensator.
    token : str
        Token required for commands; empty: no commands are accepted.
    settled : float
        A drift below this in ten minutes counts as settled [um].
    """

    service: Service
    token: str = ""
    settled: float = 1.0

    def orders_only(self) -> list[params.Depends]:
        """Return the ``dependencies`` of a route that changes something: the token is checked before the route runs."""
        door = Doorkeeper(self.token)

        def allowed(
            given: Annotated[HTTPAuthorizationCredentials | None, Depends(HTTPBearer(auto_error=False))],
        ) -> None:
            door.check(given.credentials.strip() if given else "")

        return [Depends(allowed)]


#: function named by an entry point of ``thermocomp.pages``
MakeRouter = Callable[[Board], APIRouter]


def read_template(name: str) -> jinja2.Template:
    """Return the text of an HTML template of the service's own pages."""
    return jinja2.Environment(loader=jinja2.FileSystemLoader(_FOLDER), autoescape=True).get_template(name)

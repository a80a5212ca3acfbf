"""Access control of the page: permitted host names, permitted origins, and authorisation of commands."""

import contextlib
import hmac
import json
import mimetypes
import re
import socket
import time
from collections import deque
from collections.abc import Callable, Collection
from ipaddress import IPv4Address, IPv6Address, ip_address
from typing import Any

from fastapi import HTTPException, Request
from fastapi.responses import JSONResponse
from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from thermocomp.core.shown import shorten

#: number of wrong tokens per minute that are answered with 401
MOST_WRONG = 5
#: maximum size of a command [bytes]
MOST_BYTES = 2_000
_HEADERS = {
    "Content-Security-Policy": "default-src 'self'; img-src 'self' data:; style-src 'self' 'unsafe-inline'; "
    "frame-ancestors 'none'",
    "Cross-Origin-Resource-Policy": "same-origin",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
}
_HOST = re.compile(r"(\[[0-9A-Fa-f:.]+\]|[^\[\]:/?#@\\\s]+)(:[0-9]{1,5})?")


class Json(JSONResponse):
    """JSON in plain ASCII, so that any text can be encoded; numbers that JSON lacks become null.

    Parameters
    ----------
    content : object
        As for `write_json`.
    status_code, headers, media_type, background
        As for the response.
    """

    def render(self, content: Any) -> bytes:
        """Return the content of the response as bytes; see `write_json`."""
        return write_json(content)


def declare_types() -> None:
    """Declare the types of the files of a page: Windows may take scripts for plain text, which browsers do not run."""
    mimetypes.add_type("text/javascript", ".js")
    mimetypes.add_type("text/css", ".css")


def write_json(content: Any) -> bytes:
    """Return JSON in plain ASCII; numbers that JSON lacks become null.

    Parameters
    ----------
    content : object
        Tables, lists, text, numbers, None.
    """
    return json.dumps(_clean(content), allow_nan=False).encode("ascii")


class Doorkeeper:
    """Authorises commands by a token; wrong tokens are rate-limited, the right one never is.

    Parameters
    ----------
    token : str
        Empty: no commands are accepted.
    """

    def __init__(self, token: str) -> None:
        self._token = token.encode()
        self._wrong = deque[float](maxlen=MOST_WRONG)

    def check(self, given: str) -> None:
        """Raise unless a command is authorised.

        Every token is compared: if wrong tokens could lock the page, anyone who can reach it could prevent the operator
        from holding the machine's correction. A token of 16 characters or more cannot be guessed.
        """
        if not self._token:
            raise HTTPException(403, "no token is configured: this page only displays values; set token_file in [page]")
        if hmac.compare_digest(given.encode(), self._token):
            return
        now = time.monotonic()
        if len(self._wrong) == self._wrong.maxlen and now - self._wrong[0] < 60.0:
            raise HTTPException(429, "too many wrong tokens: wait a minute", {"Retry-After": "60"})
        if given:  # an empty token is not a guess
            self._wrong.append(now)
        raise HTTPException(401, "the token is wrong", {"WWW-Authenticate": "Bearer"})


class Door:
    """ASGI middleware that refuses requests for other host names, from other origins, or of excessive size.

    Parameters
    ----------
    names : collection of str
        Host names of the page, in addition to ``localhost`` and the addresses of this computer.
    most : callable
        Function that returns the maximum size of a request [bytes].
    private : bool
        Pages that only display may be linked to, but scripts of other pages get nothing of them.
    """

    def __init__(
        self,
        app: ASGIApp,
        names: Collection[str] = (),
        most: Callable[[Request], int] = lambda _: MOST_BYTES,
        *,
        private: bool = False,
    ) -> None:
        self._app, self._most, self._private = app, most, private
        self._names = {"localhost", *map(_as_browsers_write, names)}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request."""

        async def answer(message: Message) -> None:
            if message["type"] == "http.response.start":
                for name, value in _HEADERS.items():
                    MutableHeaders(scope=message).setdefault(name, value)
            await send(message)

        app = self._app
        if scope["type"] == "http" and (refused := self._refuse(Request(scope))):
            status, why = refused
            app = Json({"detail": why}, status)
        await app(scope, receive, answer)

    def _refuse(self, request: Request) -> tuple[int, str] | None:
        headers, server = request.headers, request.scope.get("server")
        if why := explain_host(headers.get("host", ""), self._names, server[0] if server else ""):
            return 400, why
        # pages that only display may be linked to; those that answer or change something are for this page alone
        shows = request.method in ("GET", "HEAD") and "/api/" not in request.url.path
        shows = shows and not (self._private and "origin" in headers)  # a link states none
        if not shows and (why := explain_foreign(request)):
            return 403, why
        length, most = headers.get("content-length", "0"), self._most(request)
        if not (length.isascii() and length.isdigit() and len(length) < 20) or int(length) > most:
            return 413, f"a request has at most {most} bytes"
        if "transfer-encoding" in headers:
            return 413, f"a request has at most {most} bytes, and states its length (Content-Length)"
        return None


def explain_host(header: str, names: Collection[str], server: str) -> str:
    """Return the reason why a request under a host name must be refused; empty if it is permitted.

    A page of another site whose name resolves to this computer (DNS rebinding) sends that name. An address cannot be
    redirected in this way.
    """
    found = _HOST.fullmatch(header)
    name = found[1].lower().removesuffix(".") if found else ""
    if name in names:
        return ""
    address = _address(name)
    if address is not None and (address == _address(server) or address.is_loopback or _is_here(address)):
        return ""
    return f"{shorten(header, 80)!r} is not a name of this page: add it to hosts in [page] if it should be one"


def explain_foreign(request: Request) -> str:
    """Return the reason why a request comes from a page of another origin; empty if it does not.

    Browsers state the origin of the page in requests that may change something; other programs state none.
    """
    own = f"{request.url.scheme}://{request.headers.get('host', '')}".lower()
    site = request.headers.get("sec-fetch-site", "none").lower()
    if any(origin.lower() != own for origin in request.headers.getlist("origin")) or site not in (
        "same-origin",
        "none",
    ):
        return "the request came from the page of another site: open this page directly"
    return ""


def _as_browsers_write(name: str) -> str:
    with contextlib.suppress(UnicodeError):
        name = name.encode("idna").decode("ascii")
    return name.lower().removesuffix(".")


def _address(text: str) -> IPv4Address | IPv6Address | None:
    try:
        found = ip_address(text.strip("[]").partition("%")[0])
    except ValueError:
        return None
    return (found.ipv4_mapped or found) if isinstance(found, IPv6Address) else found


def _is_here(address: IPv4Address | IPv6Address) -> bool:
    """Return whether an address belongs to this computer: only those can be bound."""
    try:
        with socket.socket(socket.AF_INET if address.version == 4 else socket.AF_INET6, socket.SOCK_STREAM) as probe:
            probe.bind((str(address), 0))
    except OSError:
        return False
    return True


def _clean(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _clean(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_clean(v) for v in value]
    return None if isinstance(value, float) and not abs(value) < float("inf") else value

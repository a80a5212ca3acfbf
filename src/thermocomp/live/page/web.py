"""Web server of the page, in the event loop of the service."""

import asyncio
import contextlib
import logging
import os
import socket
import time
from collections.abc import Generator
from pathlib import Path

import uvicorn
from fastapi import FastAPI

from thermocomp.core.exceptions import InputError
from thermocomp.live.page.connections import Guarded

#: minimum length of a token [characters]
SHORTEST = 16
#: connections accepted at once: few, so that each is read before ``connections.MOST`` newer ones displace it
AT_ONCE = 16
#: backlog of connections in the system: a client without a place retries only after a second
WAITING = 1024
#: bytes of an answer buffered by the system for a client that does not read
AHEAD = 65_536
_OTHERWISE = "choose another with --port, or 0 for any"


class _Server(uvicorn.Server):
    @contextlib.contextmanager
    def capture_signals(self) -> Generator[None, None, None]:
        yield  # signals are handled by the caller

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        for one in sockets or ():
            one.listen(WAITING)

    async def on_tick(self, counter: int) -> bool:
        if counter % 10 == 0:  # once a second
            for connection in list(self.server_state.connections):
                if isinstance(connection, Guarded):
                    connection.look(time.monotonic())
        return await super().on_tick(counter)


def read_token(path: Path) -> str:
    """Return the token in a file, or raise an error if it is missing, open to others, too short or cannot be sent."""
    try:
        if os.name == "posix" and path.stat().st_mode & 0o077:
            raise InputError(f"{path}: other users of this computer can read the token: run 'chmod 600 {path}'")
        token = path.read_text(encoding="ascii").strip()
    except (OSError, UnicodeDecodeError) as e:
        raise InputError(f"{path}: the page's token cannot be read: {e}") from e
    if len(token) < SHORTEST:
        raise InputError(
            f"{path}: the token has only {len(token)} characters; expected at least {SHORTEST}, for example from "
            "'openssl rand -hex 16'"
        )
    if not token.isprintable() or " " in token:
        raise InputError(
            f"{path}: expected one token in one line, without blanks or control characters; a browser cannot send "
            "others"
        )
    return token


def listen(host: str, port: int) -> socket.socket:
    """Return a socket that listens on the host and port of the page."""
    bare = host.removeprefix("[").removesuffix("]")
    try:
        found = socket.getaddrinfo(bare, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
        family, *_, address = min(found, key=lambda one: one[0] != socket.AF_INET)  # prefer IPv4 for a name with both
        both = address[0] == "::" and socket.has_dualstack_ipv6()
        listening = socket.create_server(address, family=family, dualstack_ipv6=both)
    except (OSError, ValueError) as e:  # an invalid host name raises ValueError
        why = getattr(e, "strerror", None) or e
        do = "choose another host in [page]" if isinstance(e, socket.gaierror | ValueError) else _OTHERWISE
        raise InputError(f"page on {host}, port {port}: {why}; {do}") from e
    # a client that does not read is detected sooner and uses less memory
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, AHEAD)
    return listening


async def serve(app: FastAPI, listening: socket.socket) -> None:
    """Serve the web application of the page until cancelled."""
    config = uvicorn.Config(
        app,
        http=Guarded,
        ws="none",
        backlog=AT_ONCE,
        log_level="error",
        lifespan="off",
        access_log=False,
        timeout_graceful_shutdown=1,
    )
    server = _Server(config)
    with listening:
        try:
            await server.serve([listening])
        finally:
            # connections accepted by asyncio but not yet set up would stay open when its server closes
            with contextlib.suppress(NotImplementedError, ValueError):  # Windows; the server has closed it itself
                asyncio.get_running_loop().remove_reader(listening)
            await _turn()
            if server.started and not server.should_exit:
                server.should_exit = True
                logging.getLogger("uvicorn.error").setLevel(logging.CRITICAL)  # open streams are cancelled
                await server.shutdown([listening])
            for connection in list(server.server_state.connections):  # connections accepted meanwhile
                connection.transport.abort()
            await _turn()


async def _turn() -> None:
    """Let the event loop finish the setup of accepted connections, which takes four iterations."""
    for _ in range(4):
        await asyncio.sleep(0)

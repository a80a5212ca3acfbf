"""The page's server, in the same loop as the service."""

import contextlib
import socket
from collections.abc import Generator
from pathlib import Path

import uvicorn
from fastapi import FastAPI

from thermocomp.core.exceptions import InputError

#: characters of a token, at least
SHORTEST = 16
#: connections at once, at most: pages and whoever knocks
MOST = 100


class _Server(uvicorn.Server):
    @contextlib.contextmanager
    def capture_signals(self) -> Generator[None, None, None]:
        yield  # whoever runs the service listens to them


def read_token(path: Path) -> str:
    """Return the token in a file.

    Parameters
    ----------
    path : Path

    Raises
    ------
    InputError
        It cannot be read, or is too short.
    """
    try:
        token = path.read_text(encoding="ascii").strip()
    except (OSError, UnicodeDecodeError) as e:
        raise InputError(f"{path}: the page's token cannot be read: {e}") from e
    if len(token) < SHORTEST:
        raise InputError(
            f"{path}: a token of {len(token)} characters; want {SHORTEST} or more, such as of 'openssl rand -hex 16'"
        )
    return token


def listen(host: str, port: int) -> socket.socket:
    """Return a socket that listens.

    Parameters
    ----------
    host : str
    port : int
        0: any that is free.

    Raises
    ------
    InputError
        It is taken, or there is no such host.
    """
    try:
        return socket.create_server((host, port), family=socket.AF_INET6 if ":" in host else socket.AF_INET)
    except OSError as e:
        raise InputError(
            f"page on {host}, port {port}: {e.strerror or e}; choose another with --port, or 0 for any"
        ) from e


async def serve(app: FastAPI, listening: socket.socket) -> None:
    """Serve an application until it is cancelled.

    Parameters
    ----------
    app : FastAPI
    listening : socket
    """
    config = uvicorn.Config(
        app, log_level="warning", lifespan="off", access_log=False, limit_concurrency=MOST, timeout_graceful_shutdown=1
    )
    server = _Server(config)
    with listening:
        try:
            await server.serve([listening])
        finally:
            if server.started and not server.should_exit:
                server.should_exit = True
                await server.shutdown([listening])

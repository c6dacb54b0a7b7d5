"""Server of the studio: listens on the loopback until the page is closed, or a signal ends it."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import secrets
import socket
import sys
import threading
import webbrowser
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import uvicorn

from ..errors import InputError
from ..io.files import read_bytes
from ..limits import Limits
from .autosave import Folder, broken_off, sweep
from .content import opened
from .guard import Guard
from .jobs import Job
from .routes import application
from .session import Session

HOST = "127.0.0.1"

LINGER = 5.0
"""Seconds from when the last page is closed until the server stops; reloading takes less."""


@dataclass(frozen=True)
class Options:
    """Options of the server.

    Attributes:
        file: File to open, or None.
        port: Port to listen at; 0 for one that is free.
        browser: Whether to open the page in the browser.
        sessions: Folder of sessions, in which changes are kept.
        limits: Bounds on what files may ask for.
        jobs: Threads that work may use.
        linger: Seconds that the server stays without a page; None for ever.
        quiet: Whether to print nothing but the address.
    """

    file: str | None
    port: int
    browser: bool
    sessions: Path
    limits: Limits
    jobs: int
    linger: float | None = LINGER
    quiet: bool = False


def serve(options: Options) -> None:
    """Runs the server until it is to stop.

    Raises:
        InputError: The file cannot be read, or the port is not free.
        PxiError: The file cannot be opened.
    """
    with _listening(options.port) as listener:
        port = listener.getsockname()[1]
        session = started(options, port)
        token = secrets.token_urlsafe(24)
        address = f"http://{HOST}:{port}/?token={token}"
        server: Any = None

        def end() -> None:
            server.should_exit = True

        def ending() -> bool:
            return bool(server.should_exit)

        app = Guard(composed(session, options.linger, end, ending), token, port)
        config = uvicorn.Config(
            app, log_level="error", access_log=False, server_header=False, date_header=False,
            ws="none", timeout_graceful_shutdown=2, http="h11", loop="asyncio",
        )  # fmt: skip
        server = uvicorn.Server(config)
        print(address, flush=True)
        if not options.quiet:
            print("pxi-studio: close the page, or press Ctrl-C, to stop", file=sys.stderr)
        if options.browser:
            threading.Thread(target=webbrowser.open, args=(address,), daemon=True).start()
        server.run(sockets=[listener])


@contextlib.contextmanager
def _listening(port: int) -> Any:
    """Context with a socket that listens at a port of the loopback."""
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        if sys.platform != "win32":  # there others could share the port then
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind((HOST, port))
            listener.listen()  # who has the address can connect already
        except (OSError, OverflowError) as error:
            raise InputError(
                f"--port {port}: cannot be listened at: {error}; leave it out for a free one"
            ) from None
        yield listener
    finally:
        listener.close()


def started(options: Options, port: int) -> Session:
    """Session with the file of the options, or with what was kept of one that broke off.

    Raises:
        PxiError: The file cannot be opened.
    """
    path = None if options.file is None else Path(options.file).absolute()
    sweep(options.sessions)
    old = broken_off(options.sessions, None if path is None else str(path))
    data = None if path is None else read_bytes(path)
    folder = old or Folder.new(options.sessions)
    session = Session(folder, options.limits, options.jobs, path, port)
    if old is not None and session.recover():
        return session
    if path is not None and data is not None:
        try:
            content = opened(data, path.name, options.limits, options.jobs, Job("open"))
        except Exception:
            folder.remove()
            raise
        session.begin_with(content, str(path))
    return session


def composed(
    session: Session,
    linger: float | None = None,
    end: Callable[[], None] = lambda: None,
    ending: Callable[[], bool] = lambda: False,
) -> Any:
    """ASGI application of a session, which begins and ends with the server.

    Args:
        session: The session.
        linger: Seconds without a page after which `end` is called; None for never.
        end: Ends the server.
        ending: Whether the server waits for its connections to end.
    """

    async def farewell() -> None:
        while not ending():
            await asyncio.sleep(0.1)
        session.publish("bye", {"reason": "pxi-studio was stopped"})

    def gone() -> None:
        if linger is not None:
            asyncio.get_running_loop().call_later(linger, alone)

    def alone() -> None:
        if not session.watched:
            end()

    @contextlib.asynccontextmanager
    async def lifespan(app: Any) -> AsyncIterator[None]:
        session.start()
        waiting = asyncio.create_task(farewell())
        handler = _Warnings(session)
        log = logging.getLogger("proxyimg_codec")
        log.addHandler(handler)
        try:
            yield
        finally:
            log.removeHandler(handler)
            waiting.cancel()
            await session.stop()

    return application(session, gone, lifespan=lifespan)


class _Warnings(logging.Handler):
    """Handler that tells the page what the package logs as warnings."""

    def __init__(self, session: Session) -> None:
        super().__init__(logging.WARNING)
        self._session = session

    def emit(self, record: logging.LogRecord) -> None:
        """Tells of one warning."""
        self._session.publish_from_thread("warning", {"message": record.getMessage()})

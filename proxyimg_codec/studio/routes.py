"""Requests of the page, see `README.md`."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Awaitable, Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response, StreamingResponse
from starlette.routing import Route

from ..errors import PxiError, UsageError
from ..io.files import read_bytes
from . import drawing
from .autosave import plain_name
from .content import Content, is_layered, opened
from .drawing_routes import DrawingRoutes
from .exporting import export
from .failures import MissingError, described
from .jobs import Job
from .region_requests import changed, searched
from .requests import (
    body_of,
    json_of,
    number_of,
    picture_answer,
    text_of,
)
from .session import Change, Session

PAGE = Path(__file__).parent / "page"

SUFFIXES = {
    ".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml",
    ".png": "image/png", ".woff2": "font/woff2", ".json": "application/json",
}  # fmt: skip
"""Types of the files of the page."""

PING = 2.0
"""Seconds between signs of life to the page."""

Handler = Callable[[Request], Awaitable[Response]]


def application(session: Session, gone: Callable[[], None] = lambda: None, **more: Any) -> Any:
    """ASGI application of a session, without the guard.

    Args:
        session: The session.
        gone: Called when the last page that listened to events has left.
        more: Arguments of Starlette, such as ``lifespan``.
    """
    routes, drawn = _Routes(session, gone), DrawingRoutes(session)
    paths: list[tuple[str, str, Handler]] = [
        ("GET", "/", routes.page),
        ("GET", "/page/{path:path}", routes.page),
        ("GET", "/api/state", routes.state),
        ("GET", "/api/events", routes.events),
        ("POST", "/api/open", routes.open),
        ("POST", "/api/files", routes.add_file),
        ("POST", "/api/close", routes.close),
        ("POST", "/api/reload", routes.reload),
        ("GET", "/api/source.png", routes.source),
        ("POST", "/api/regions/{action}", routes.regions),
        ("POST", "/api/encode", routes.encode),
        ("POST", "/api/edit", routes.edit),
        ("POST", "/api/undo", routes.undo),
        ("POST", "/api/redo", routes.redo),
        ("POST", "/api/jump", routes.jump),
        ("POST", "/api/cancel", routes.cancel),
        ("GET", "/api/render", drawn.render),
        ("GET", "/api/layers/{index:int}/thumbnail.png", drawn.thumbnail),
        ("GET", "/api/layers/{index:int}/texture", drawn.texture),
        ("GET", "/api/layers/{index:int}/mesh", drawn.mesh),
        ("GET", "/api/layers/{index:int}/outline", drawn.outline),
        ("GET", "/api/presets", drawn.presets),
        ("GET", "/api/motion", drawn.motion),
        ("POST", "/api/motion", drawn.simulate),
        ("POST", "/api/save", routes.save),
        ("POST", "/api/export", routes.export),
        ("GET", "/api/exports/{name}", routes.exported),
    ]
    return Starlette(
        routes=[Route(path, handler, methods=[method]) for method, path, handler in paths],
        exception_handlers={HTTPException: _http_error, Exception: _error, PxiError: _error},
        **more,
    )


async def _error(request: Request, error: Exception) -> Response:
    status, facts = described(error)
    return JSONResponse({"error": facts}, status)


async def _http_error(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException), "it is registered for these"
    facts = {"kind": "missing", "message": f"{request.url.path}: {error.detail}"}
    return JSONResponse({"error": facts}, error.status_code)


class _Routes:
    """Handlers of requests about a session; `gone` is called when no page listens any more."""

    def __init__(self, session: Session, gone: Callable[[], None]) -> None:
        self._session, self._gone = session, gone

    async def page(self, request: Request) -> Response:
        """File of the page."""
        path = request.path_params.get("path", "index.html")
        place = (PAGE / path).resolve()
        kind = SUFFIXES.get(place.suffix)
        if kind is None or not place.is_relative_to(PAGE) or not place.is_file():
            raise MissingError(f"{request.url.path}: there is no such file")
        headers = {"cache-control": "no-cache"}
        return FileResponse(place, media_type=kind, headers=headers)

    async def state(self, request: Request) -> Response:
        """State of the session."""
        return self._state()

    def _state(self) -> Response:
        return JSONResponse(self._session.state(), headers={"cache-control": "no-store"})

    async def events(self, request: Request) -> Response:
        """Stream of events, whose end is the end of a page."""
        queue = self._session.listen()

        async def stream() -> AsyncIterator[bytes]:
            try:
                while True:
                    try:
                        name, data = await asyncio.wait_for(queue.get(), PING)
                    except TimeoutError:
                        yield b": still here\n\n"
                        continue
                    yield f"event: {name}\ndata: {json.dumps(data)}\n\n".encode()
                    if name == "bye":
                        return
            finally:
                if not self._session.unlisten(queue):
                    self._gone()

        headers = {"cache-control": "no-store", "x-accel-buffering": "no"}
        return StreamingResponse(stream(), media_type="text/event-stream", headers=headers)

    # Opening

    async def open(self, request: Request) -> Response:
        """Opens a file that the page sends."""
        session = self._session
        data = await body_of(request, session.limits.file_bytes)
        name = plain_name(text_of(request.query_params, "name"))

        def work(content: Content, job: Job) -> Content:
            return opened(data, name, session.limits, session.jobs, job)

        if is_layered(data, name):
            return await self._begun(request, "encode", work)
        await session.change("open", work)
        if session.content.stage == "editing":
            session.mark_saved()
        return self._state()

    async def add_file(self, request: Request) -> Response:
        """Adds a file that edits may name."""
        session = self._session
        data = await body_of(request, session.limits.file_bytes)
        name = text_of(request.query_params, "name")
        added = await session.read(lambda: session.folder.add(name, data))
        session.publish_state()
        return JSONResponse({"name": added})

    async def close(self, request: Request) -> Response:
        """Gives up the content."""
        await self._session.change("close", lambda content, job: Content())
        return self._state()

    async def reload(self, request: Request) -> Response:
        """Opens the file again that the server was started with, as it is on disk."""
        session = self._session
        path = session.path
        if path is None:
            raise UsageError("the studio was started without a file; drop one onto the page")

        def work(content: Content, job: Job) -> Content:
            data = read_bytes(path)
            found = opened(data, path.name, session.limits, session.jobs, job)
            return replace(found, path=str(path))

        await session.change("open", work)
        if path.suffix.lower() == ".pxi":
            session.mark_saved()
        return self._state()

    async def source(self, request: Request) -> Response:
        """The raster that was opened."""
        pointing = self._session.content.pointing
        if pointing is None:
            raise MissingError("no raster is open")
        width = number_of(request.query_params, "width", 1, 1 << 15)

        def work() -> bytes:
            return drawing.raster_png(pointing.raster, None if width is None else int(width))

        return picture_answer(await self._session.read(work))

    # Pointing

    async def regions(self, request: Request) -> Response:
        """Changes the regions of a raster."""
        values, session = await json_of(request), self._session
        action = request.path_params["action"]
        if action == "find":
            count = values.get("max_layers", 4)
            if not isinstance(count, int) or isinstance(count, bool) or not 1 <= count <= 64:
                raise UsageError(f"max_layers: {count!r} is not a whole number in 1..64")
            return await self._begun(request, "find", searched(session.jobs, count))
        await session.change(action, changed(action, values, session.jobs))
        return self._state()

    async def encode(self, request: Request) -> Response:
        """Makes a document of the regions."""
        values, session = await json_of(request), self._session

        def work(content: Content, job: Job) -> Content:
            return content.encoded(values, session.jobs, job)

        def result(content: Content) -> Any:
            return {"bytes": len(content.edited.to_bytes())}

        return await self._begun(request, "encode", work, result)

    async def _begun(
        self,
        request: Request,
        kind: str,
        work: Change,
        result: Callable[[Content], Any] = lambda content: None,
    ) -> Response:
        """Begins a long change; with ``wait`` in the address, answers when it has ended."""
        session = self._session
        if "wait" in request.query_params:
            await session.change(kind, work)
            return JSONResponse({"result": result(session.content), **session.state()})
        return JSONResponse({"job": session.begin_change(kind, work, result)}, 202)

    # Editing

    async def edit(self, request: Request) -> Response:
        """Applies edits."""
        values, session = await json_of(request), self._session
        edits, version = values.get("edits"), values.get("version")
        if not isinstance(edits, list) or not edits:
            raise UsageError("edits: must be a list of operations")
        if version is not None and not isinstance(version, int):
            raise UsageError("version: must be a whole number")
        folder = session.folder

        def work(content: Content, job: Job) -> Content:
            return content.with_edits(edits, folder.files, folder.names())

        await session.change("edit", work, version)
        return self._state()

    async def undo(self, request: Request) -> Response:
        """Takes back the last edits."""
        return await self._jumped(request, lambda at, steps: at - steps)

    async def redo(self, request: Request) -> Response:
        """Does edits again that were taken back."""
        return await self._jumped(request, lambda at, steps: at + steps)

    async def jump(self, request: Request) -> Response:
        """Goes to a state of the history."""
        return await self._jumped(request, lambda at, to: to, "to")

    async def _jumped(
        self, request: Request, place: Callable[[int, int], int], key: str = "steps"
    ) -> Response:
        count = (await json_of(request)).get(key, 1)
        if not isinstance(count, int) or isinstance(count, bool) or count < 0:
            raise UsageError(f"{key}: {count!r} is not a whole number of edits")

        def work(content: Content, job: Job) -> Content:
            document = content.edited
            return replace(content, document=document.jumped(place(document.at, count)))

        await self._session.change("jump", work)
        return self._state()

    async def cancel(self, request: Request) -> Response:
        """Ends the work that is going on."""
        self._session.cancel()
        return JSONResponse({})

    # Saving

    async def save(self, request: Request) -> Response:
        """Writes the file."""
        values = await json_of(request)
        await self._session.save(values.get("replace") is True)
        return self._state()

    async def export(self, request: Request) -> Response:
        """Makes a file to be taken."""
        values, session = await json_of(request), self._session
        content = session.content

        async def run(job: Job) -> Any:
            def work() -> str:
                return export(
                    content, values, session.folder.exports, session.limits, session.jobs, job
                )

            name = await session.read(work, job)
            size = (session.folder.exports / name).stat().st_size
            return {"name": name, "bytes": size, "url": f"/api/exports/{name}"}

        if "wait" in request.query_params:
            return JSONResponse({"result": await run(Job("export"))})
        return JSONResponse({"job": session.begin("export", run)}, 202)

    async def exported(self, request: Request) -> Response:
        """File that was made by `export`."""
        name = request.path_params["name"]
        folder = self._session.folder.exports
        if name not in {file.name for file in folder.iterdir()}:
            raise MissingError(f"{name}: nothing of that name was exported")
        return FileResponse(folder / name, filename=name, headers={"cache-control": "no-store"})

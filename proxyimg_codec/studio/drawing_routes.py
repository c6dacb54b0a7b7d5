"""Requests for what is drawn, and for motions."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from typing import Any

from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from . import drawing, poses
from .failures import MissingError
from .jobs import Job
from .requests import binary_answer, json_of, number_of, pixels_answer, wanted_of
from .session import Session


class DrawingRoutes:
    """Handlers of requests that change nothing.

    Args:
        session: The session.
    """

    def __init__(self, session: Session) -> None:
        self._session = session

    async def render(self, request: Request) -> Response:
        """Exact picture of a region at a size."""
        query, session = request.query_params, self._session
        picture = session.content.edited.picture
        wanted = wanted_of(query, picture.size)

        def work(job: Job) -> Response:
            pixels = drawing.exact(picture, wanted, session.limits, session.cache, job.advance)
            return pixels_answer(pixels, query.get("format", "png"))

        return await self._drawn(request, work)

    async def thumbnail(self, request: Request) -> Response:
        """One layer as it is now, small."""
        session = self._session
        index, picture = self._layer(request)
        side = int(number_of(request.query_params, "side", 1, 1024) or 96)

        def work(job: Job) -> Response:
            return pixels_answer(
                drawing.thumbnail(picture, index, side, session.limits, session.cache, job.advance),
                "png",
            )

        return await self._drawn(request, work)

    async def texture(self, request: Request) -> Response:
        """Texture of a layer at rest."""
        session, query = self._session, request.query_params
        index, picture = self._layer(request)
        scale = number_of(query, "scale", 1 / 64, 16) or 1.0

        def work(job: Job) -> Response:
            pixels, box = drawing.texture(
                picture, index, scale, session.limits, job.advance, "whole" in query
            )
            more = {"x-box": ",".join(map(str, box))}
            return pixels_answer(pixels, query.get("format", "raw"), more)

        return await self._drawn(request, work)

    async def mesh(self, request: Request) -> Response:
        """Mesh of a layer."""
        index, picture = self._layer(request)
        layer = picture.layers[index]
        return JSONResponse(await self._session.read(lambda: drawing.mesh(picture, layer)))

    async def outline(self, request: Request) -> Response:
        """Control points of the outline of a layer."""
        index, picture = self._layer(request)
        layer = picture.layers[index]
        paths = await self._session.read(lambda: drawing.control_points(layer))
        return JSONResponse({"paths": paths})

    def _layer(self, request: Request) -> tuple[int, Any]:
        """Number of a layer of the present picture, and that picture."""
        picture, index = self._session.content.edited.picture, request.path_params["index"]
        if index >= len(picture.layers):
            raise MissingError(f"there is no layer {index}; there are {len(picture.layers)}")
        return index, picture

    async def _drawn(self, request: Request, work: Callable[[Job], Response]) -> Response:
        """Answers with what is drawn in a thread, which ends when nobody waits for it any more."""
        job = Job("render")
        drawn = asyncio.ensure_future(self._session.read(lambda: work(job)))
        while not drawn.done():
            await asyncio.wait([drawn], timeout=0.05)
            if not drawn.done() and await request.is_disconnected():
                job.cancel()
        return drawn.result()

    async def presets(self, request: Request) -> Response:
        """Presets of motions."""
        return JSONResponse(poses.known_presets())

    async def motion(self, request: Request) -> Response:
        """Poses of the motion that the picture has."""
        picture = self._session.content.edited.picture
        if picture.timeline is None:
            raise MissingError("the picture does not move")
        return binary_answer(await self._session.read(lambda: poses.packed(picture)))

    async def simulate(self, request: Request) -> Response:
        """Poses of a motion that the picture does not have as yet."""
        values, session = await json_of(request), self._session
        picture = session.content.edited.picture
        job = Job("motion", lambda job: session.publish_from_thread("job", job.described()))

        def work() -> tuple[bytes, str]:
            motion = poses.motion_of(picture, values)
            moving = poses.moving(picture, motion, job)
            return poses.packed(moving), json.dumps(motion.to_dict())

        data, words = await session.read(work, job)
        return binary_answer(data, {"x-motion": words})

"""Frames of a picture with a motion, rendered in order on several threads."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import UsageError
from ..model import Pictured
from ..render.cache import Cache
from ..render.pixels import render


def times(
    image: Pictured, *, duration: float | None = None, fps: float | None = None
) -> list[float]:
    """Times of the frames of a clip in seconds.

    Args:
        image: A picture with a motion.
        duration: Duration of the clip in seconds, at most 3600; by default that of the timeline.
        fps: Frames per second, at most 240; by default the rate that the timeline was made for.

    Raises:
        UsageError: The picture has no motion, or a number is out of range.
    """
    timeline = image.picture.timeline
    if timeline is None:
        raise UsageError("the picture does not move; give it a motion first (pxi-animate)")
    duration = timeline.seconds if duration is None else duration
    fps = timeline.fps if fps is None else fps
    if not (0 < fps <= 240 and 0 < duration <= 3600):
        raise UsageError(
            f"{duration:g} s at {fps:g} frames a second: up to 3600 s, and 240 a second"
        )
    return [k / fps for k in range(max(round(duration * fps), 1))]


def frames(
    image: Pictured, at: list[float], *, jobs: int = 2, **options: Any
) -> Iterator[NDArray[np.uint8]]:
    """Renders a picture at several times.

    Layers that do not move are rendered once for all frames.

    Args:
        image: A picture with a motion.
        at: Times in seconds.
        jobs: Number of threads.
        options: Options of `Image.render`, such as ``scale``.

    Yields:
        uint8 [H, W, 3 or 4] frame for each time.
    """
    cache = getattr(image, "cache", None) or Cache()

    def frame(t: float) -> NDArray[np.uint8]:
        return np.asarray(render(image, t=t, cache=cache, **options))

    with ThreadPoolExecutor(jobs) as pool:
        waiting: deque[Future[NDArray[np.uint8]]] = deque()
        try:
            for t in at:
                waiting.append(pool.submit(frame, t))
                if len(waiting) > jobs:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:
            for future in waiting:
                future.cancel()

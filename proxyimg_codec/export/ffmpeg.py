"""FFmpeg through PyAV: frames, and chains of filters."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import UnsupportedError

if TYPE_CHECKING:
    from av import VideoFrame
    from av.filter import Graph

Frame = NDArray[np.uint8]
"""Pixels uint8 [H, W, 3], or [H, W, 4] with straight alpha."""


def import_av() -> Any:
    """Imports PyAV.

    Raises:
        UnsupportedError: PyAV is not installed.
    """
    try:
        import av
    except ImportError:
        raise UnsupportedError(
            "video and animated pictures need PyAV: pip install 'proxyimg-codec[animate]'"
        ) from None
    return av


def write_errors() -> tuple[type[Exception], ...]:
    """Classes of errors that are raised if a clip cannot be written."""
    with contextlib.suppress(UnsupportedError):
        return (OSError, import_av().FFmpegError)
    return (OSError,)


def layout_of(frame: Frame) -> str:
    """FFmpeg's name of the pixel format of a frame."""
    return "rgba" if frame.shape[2] == 4 else "rgb24"


def video_frame(frame: Frame, number: int) -> VideoFrame:
    """Wraps a frame, which is shown at tick `number`, for FFmpeg."""
    picture: VideoFrame = import_av().VideoFrame.from_ndarray(frame, layout_of(frame))
    picture.pts = number
    return picture


def graph(steps: list[tuple[str, str]], inputs: list[tuple[int, int, str]]) -> Graph:
    """Chain of FFmpeg's filters.

    Args:
        steps: Name and arguments of each filter.
        inputs: Width, height and pixel format of each input of the first filter.
    """
    av = import_av()
    chain: Graph = av.filter.Graph()
    chain.threads = 1
    nodes = [chain.add(*step) for step in steps] + [chain.add("buffersink")]
    for k, (width, height, layout) in enumerate(inputs):
        form = av.VideoFormat(layout)
        source = chain.add_buffer(
            width=width, height=height, format=form, name=f"in{k}", time_base=Fraction(1)
        )
        source.link_to(nodes[0], 0, k)
    chain.link_nodes(*nodes)
    chain.configure(auto_buffer=False)
    return chain


def pulled(chain: Graph) -> Iterator[VideoFrame]:
    """Takes all frames that a chain has ready."""
    av = import_av()
    with contextlib.suppress(av.BlockingIOError, av.EOFError):
        while True:
            yield chain.vpull()

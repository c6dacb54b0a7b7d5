"""Clips as a video or an animated picture, written by FFmpeg through PyAV; see `clip`."""

from __future__ import annotations

import contextlib
import io
import math
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .ffmpeg import Frame, graph, import_av, layout_of, pulled, video_frame, write_errors

if TYPE_CHECKING:
    from av import VideoFrame
    from av.filter import Graph

MOVIES = ("mp4", "webm", "webp", "gif", "apng")
"""Kinds of targets that need PyAV."""


def movie_of(
    kind: str, file: Path, first: Frame, rate: Fraction, loop: bool, quality: int
) -> _Movie | _Gif:
    """Creates the coder of a file that FFmpeg writes.

    Args:
        kind: One of `MOVIES`.
        file: File to write; its folder also gets temporary files.
        first: The first frame, uint8 [H, W, 3 or 4]; only its size and content are examined.
        rate: Frames a second.
        loop: Whether the clip repeats for ever.
        quality: 0 to 100.
    """
    alpha = first.shape[2] == 4
    if kind == "gif":
        return _Gif(file, first, rate, loop)
    if kind == "webp":
        lossless = quality == 100 or _lossless_is_no_larger(first, quality)
        coding = _webp(loop, quality, lossless)
    elif kind == "apng":
        coding = _apng(alpha, loop)
    else:
        coding = _mp4(quality) if kind == "mp4" else _webm(alpha, quality)
    return _Movie(file, coding, first, rate)


@dataclass(frozen=True)
class _Coding:
    """Settings with which FFmpeg writes a file.

    Attributes:
        container: FFmpeg's name of the file type.
        codec: FFmpeg's name of the encoder.
        pixels: FFmpeg's name of the pixel format.
        options: Options of the encoder.
        muxing: Options of the container.
        ticks: Ticks a second, if the file counts time in ticks; None if it counts frames.
    """

    container: str
    codec: str
    pixels: str
    options: dict[str, str] = field(default_factory=dict)
    muxing: dict[str, str] = field(default_factory=dict)
    ticks: int | None = None

    @property
    def is_video(self) -> bool:
        """Whether colours are Y'CbCr in the limited range, and sides even."""
        return self.pixels.startswith("yuv")


def _mp4(quality: int) -> _Coding:
    crf = 12 + (100 - quality) * 39 / 100
    options = {"preset": "slow", "crf": f"{crf:.2f}"}
    return _Coding("mp4", "libx264", "yuv420p", options, {"movflags": "+faststart"})


def _webm(alpha: bool, quality: int) -> _Coding:
    crf = 14 + (100 - quality) * 49 // 100
    options = {"deadline": "good", "cpu-used": "3", "crf": str(crf), "b": "0"}
    return _Coding("webm", "libvpx-vp9", "yuva420p" if alpha else "yuv420p", options)


def _webp(loop: bool, quality: int, lossless: bool) -> _Coding:
    # For lossless WebP, the option `quality` means effort.
    options = {"lossless": str(int(lossless)), "quality": str(50 if lossless else quality)}
    muxing = {"loop": str(int(not loop))}
    return _Coding("webp", "libwebp_anim", "bgra", options, muxing, 1000)


def _apng(alpha: bool, loop: bool) -> _Coding:
    options = {"pred": "mixed", "compression_level": "4"}
    return _Coding(
        "apng", "apng", "rgba" if alpha else "rgb24", options, {"plays": str(int(not loop))}
    )


def _gif(loop: bool) -> _Coding:
    return _Coding("gif", "gif", "pal8", muxing={"loop": "0" if loop else "-1"}, ticks=100)


class _Movie:
    """File that FFmpeg writes.

    Video is converted with the matrix of ITU-R BT.709, and the file says so. Its primaries and its
    transfer function are marked as those of sRGB (ITU-T H.273, code points 1 and 13).
    """

    def __init__(
        self, file: Path | io.BytesIO, coding: _Coding, first: Frame, rate: Fraction
    ) -> None:
        av = import_av()
        self._coding = coding
        self._rate = rate
        self._count = 0
        height, width = (n + (n & 1 if coding.is_video else 0) for n in first.shape[:2])
        self._pad = ((0, height - first.shape[0]), (0, width - first.shape[1]), (0, 0))
        self._container = av.open(
            file if isinstance(file, io.BytesIO) else str(file),
            "w",
            format=coding.container,
            options={"fflags": "+bitexact", **coding.muxing},
        )
        stream = self._container.add_stream(coding.codec, rate=rate, options=coding.options)
        stream.width, stream.height, stream.pix_fmt = width, height, coding.pixels
        context = stream.codec_context
        context.time_base = Fraction(1, coding.ticks) if coding.ticks else 1 / rate
        # The bytes that encoders write depend on the number of threads.
        context.thread_count = 1
        context.flags |= av.codec.context.Flags.bitexact
        if coding.is_video:
            context.color_primaries, context.color_trc = 1, 13
            context.colorspace, context.color_range = 1, 1
        self._stream = stream
        self._input = (width, height, layout_of(first))

    @cached_property
    def _converter(self) -> Graph:
        """Filter from the pixels of frames to those of the encoder."""
        steps = [("format", f"pix_fmts={self._coding.pixels}")]
        if self._coding.is_video:
            flags = "bicubic+accurate_rnd+full_chroma_int+full_chroma_inp"
            steps.insert(0, ("scale", f"flags={flags}:out_color_matrix=bt709:out_range=tv"))
        return graph(steps, [self._input])

    def add(self, frame: Frame) -> None:
        """Takes the next frame, uint8 [H, W, 3 or 4]."""
        if self._coding.is_video:
            frame = np.pad(frame, self._pad, mode="edge")
        self._converter.push(video_frame(frame, self._count))
        self.encode(next(pulled(self._converter)))

    def encode(self, picture: VideoFrame) -> None:
        """Encodes a frame that is in the pixel format of the encoder."""
        ticks = self._coding.ticks
        picture.pts = round(self._count * ticks / self._rate) if ticks else self._count
        picture.time_base = self._stream.codec_context.time_base
        if self._coding.is_video:
            picture.color_primaries, picture.color_trc = 1, 13
        self._count += 1
        self._container.mux(self._stream.encode(picture))

    def finish(self) -> None:
        """Completes the file."""
        self._container.mux(self._stream.encode())
        self._container.close()

    def close(self) -> None:
        """Closes the file."""
        # After a failure, closing tries to complete the file; it does not matter if that fails too.
        with contextlib.suppress(*write_errors()):
            self._container.close()


class _Gif:
    """GIF with one palette for all frames, which are therefore read twice.

    With a palette for each frame, files were 1.3 to 2.3 times as large, and flickered. Error
    diffusion is nearer to the colours than an ordered pattern, and FFmpeg confines it to the box of
    the pixels that change.
    """

    def __init__(self, file: Path, first: Frame, rate: Fraction, loop: bool) -> None:
        self._shape = first.shape
        self._spool = file.with_suffix(".frames")
        self._movie = _Movie(file, _gif(loop), first, rate)
        self._count = 0
        self._input = (first.shape[1], first.shape[0], layout_of(first))
        self._palette = graph([("palettegen", "stats_mode=full")], [self._input])

    def add(self, frame: Frame) -> None:
        """Takes the next frame, uint8 [H, W, 3 or 4]."""
        with open(self._spool, "ab") as spool:
            spool.write(frame.data)
        self._palette.push(video_frame(frame, self._count))
        self._count += 1

    def finish(self) -> None:
        """Completes the file."""
        self._palette.push(None)
        palette = next(pulled(self._palette))
        steps = [("paletteuse", "dither=sierra3:diff_mode=rectangle:alpha_threshold=128")]
        colours = graph(steps, [self._input, (palette.width, palette.height, palette.format.name)])
        palette.pts = 0
        colours.push(palette, 1)
        colours.push(None, 1)
        with open(self._spool, "rb") as spool:
            for k in range(self._count):
                frame = np.fromfile(spool, np.uint8, math.prod(self._shape))
                colours.push(video_frame(frame.reshape(self._shape), k), 0)
                self._encode(colours)
        colours.push(None, 0)
        self._encode(colours)
        self._spool.unlink()
        self._movie.finish()

    def _encode(self, colours: Graph) -> None:
        for picture in pulled(colours):
            self._movie.encode(picture)

    def close(self) -> None:
        """Closes the file."""
        self._movie.close()


def _lossless_is_no_larger(first: Frame, quality: int) -> bool:
    """Whether the first frame as lossless WebP is no larger than as lossy WebP.

    It is for flat drawings.
    """
    sizes = []
    for lossless in (True, False):
        buffer = io.BytesIO()
        movie = _Movie(buffer, _webp(True, quality, lossless), first, Fraction(1))
        movie.add(first)
        movie.finish()
        sizes.append(len(buffer.getvalue()))
    return sizes[0] <= sizes[1]

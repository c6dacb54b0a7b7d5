"""Table of the codecs that are compared."""

from __future__ import annotations

import hashlib
import io
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._version import __version__
from ..errors import UsageError

Pixels = NDArray[np.uint8]

EFFORT, FAST_EFFORT = 5, 2
"""Efforts of our own codec: of ``pxi`` by default, and of ``pxi-fast``."""


@dataclass(frozen=True)
class Codec:
    """One codec with fixed settings.

    All its attributes can be pickled, because it is called in other processes.

    Attributes:
        name: Name on the command line and in tables.
        label: Name in plots.
        settings: Description of the fixed settings.
        qualities: Default qualities in the codec's own measure; on photographs they lead to 0.1 to
            1.5 bits per pixel.
        limits: Least and greatest quality.
        encode: Function from uint8 [H, W, 3 or 4] and a quality to a whole file; it also takes
            ``masks`` if the attribute of that name is set.
        decode: Function from a file to uint8 [H, W, 3 or 4].
        version: Function that returns the versions of the libraries behind the codec.
        whole: Whether qualities are whole numbers.
        alpha: Whether the codec can code transparency.
        masks: Whether the codec codes the layers of label maps.
        default: Whether the codec runs if the command line names no codecs.
    """

    name: str
    label: str
    settings: str
    qualities: tuple[float, ...]
    limits: tuple[float, float]
    encode: Callable[..., bytes]
    decode: Callable[[bytes], Pixels]
    version: Callable[[], str]
    whole: bool = False
    alpha: bool = True
    masks: bool = False
    default: bool = True

    def checked(self, quality: float) -> float:
        """Checks a quality, and returns it.

        Raises:
            UsageError: The quality is out of range, or should be a whole number.
        """
        low, high = self.limits
        if not low <= quality <= high or (self.whole and quality != round(quality)):
            kind = "a whole number" if self.whole else "a number"
            raise UsageError(
                f"quality {quality:g} of {self.name} must be {kind} from {low:g} to {high:g}"
            )
        return quality


def pillow_encode(pixels: Pixels, quality: float, *, kind: str, **options: Any) -> bytes:
    """Encodes a picture uint8 [H, W, 3 or 4] as a file of type `kind` with Pillow."""
    from PIL import Image

    file = io.BytesIO()
    Image.fromarray(pixels).save(file, kind, quality=int(quality), **options)
    return file.getvalue()


def jpeg2000_encode(pixels: Pixels, quality: float) -> bytes:
    """Encodes a JPEG 2000 file at `quality` bits per pixel: 9/7 wavelet, colour transform."""
    from PIL import Image

    file = io.BytesIO()
    ratio = 8 * pixels.shape[2] / quality
    Image.fromarray(pixels).save(
        file, "JPEG2000", quality_mode="rates", quality_layers=[ratio], irreversible=True, mct=1
    )
    return file.getvalue()


def pillow_decode(data: bytes) -> Pixels:
    """Decodes a file with Pillow to uint8 [H, W, 3 or 4]."""
    from PIL import Image

    with Image.open(io.BytesIO(data)) as image:
        kind = "RGBA" if image.has_transparency_data else "RGB"
        return np.asarray(image.convert(kind))


def jpegxl_encode(pixels: Pixels, quality: float) -> bytes:
    """Encodes a JPEG XL file at a quality of libjxl, with effort 7."""
    import imagecodecs

    return bytes(imagecodecs.jpegxl_encode(pixels, int(quality), effort=7, numthreads=1))


def jpegxl_decode(data: bytes) -> Pixels:
    """Decodes a JPEG XL file to uint8."""
    import imagecodecs

    return np.asarray(imagecodecs.jpegxl_decode(data, numthreads=1), np.uint8)


def svt_encode(pixels: Pixels, quality: float, *, preset: int) -> bytes:
    """Encodes an opaque AVIF file, 4:2:0, by SVT-AV1 at a CRF of `quality`, tuned for PSNR."""
    # The library tells its settings on stderr.
    os.environ.setdefault("SVT_LOG", "1")
    import av

    options = {"crf": f"{quality:g}", "preset": str(preset), "svtav1-params": "lp=1:avif=1:tune=1"}
    file = io.BytesIO()
    with av.open(file, "w", format="avif") as out:
        stream = out.add_stream("libsvtav1", rate=1, options=options)
        stream.height, stream.width = pixels.shape[:2]
        stream.pix_fmt = "yuv420p"
        coder = stream.codec_context
        coder.color_range, coder.colorspace = BT601
        frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(pixels), format="rgb24")
        frame = frame.reformat(
            format="yuv420p", dst_colorspace="ITU601", dst_color_range="JPEG", interpolation="AREA"
        )
        for packet in (*stream.encode(frame), *stream.encode(None)):
            out.mux(packet)
    return file.getvalue()


def svt_version() -> str:
    """Versions of PyAV and libavcodec, which carry SVT-AV1."""
    import av

    return (
        f"PyAV {av.__version__}, libavcodec {'.'.join(map(str, av.library_versions['libavcodec']))}"
    )


def pxi_encode(
    pixels: Pixels, quality: float, *, masks: Sequence[Any] | None = None, **options: Any
) -> bytes:
    """Encodes a .pxi file on one thread, with one layer if there are no masks."""
    from ..api import encode

    if masks is None:
        options["max_layers"] = 1
    image = encode(pixels, masks=masks, quality=quality, jobs=1, **options)
    return image.to_bytes()


def pxi_decode(data: bytes) -> Pixels:
    """Decodes a .pxi file to uint8 [H, W, 3 or 4]."""
    from ..api import from_bytes

    return np.asarray(from_bytes(data).render())


def pillow_version(feature: str) -> str:
    """Versions of Pillow and of the library behind one of its formats."""
    from PIL import __version__ as pillow
    from PIL import features

    library = features.version(feature)
    if feature == "avif":
        from PIL import _avif

        library = f"{library} ({_avif.codec_versions()})"
    return f"Pillow {pillow}, {feature} {library}"


def jpegxl_version() -> str:
    """Versions of imagecodecs and libjxl."""
    import imagecodecs

    return f"imagecodecs {imagecodecs.__version__}, {imagecodecs.jpegxl_version()}"


def pxi_version() -> str:
    """Version of this package with a hash of its code and weights, which change between releases.

    Measurements of an earlier run are reused only if this is the same.
    """
    root, hasher = Path(__file__).parents[1], hashlib.sha256()
    apart = {"__pycache__", "bench", "cli", "edit", "export"}
    for path in sorted(root.rglob("*")):
        if path.is_file() and not apart & set(path.relative_to(root).parts):
            hasher.update(path.read_bytes())
    return f"proxyimg-codec {__version__}+{hasher.hexdigest()[:10]}"


EQUAL_TIME = (0, 1, 2, 3)
"""Speeds of AVIF that may take as long as our own codec; its entry at speed 4 is `avif444`."""

AVIF_QUALITIES = {
    "4:2:0": (8.0, 22.0, 34.0, 44.0, 54.0, 64.0, 75.0),
    "4:4:4": (7.0, 20.0, 32.0, 42.0, 51.0, 60.0, 72.0),
}

SVT_QUALITIES = (63.0, 58.0, 51.0, 45.0, 38.0, 30.0, 22.0)

BT601 = 2, 5
"""Full range and the matrix of BT.601, in the numbers of libavutil."""

PXI_QUALITIES = (20.0, 31.0, 43.0, 55.0, 67.0)


def avif(name: str, label: str, speed: int, subsampling: str, default: bool = True) -> Codec:
    """Entry for AVIF by libaom, tuned for PSNR; Pillow's default is tuned for perception."""
    encode = partial(
        pillow_encode, kind="AVIF", codec="aom", speed=speed, subsampling=subsampling,
        advanced={"tune": "psnr"}, max_threads=1, autotiling=False,
    )  # fmt: skip
    settings = f"libaom, speed {speed}, {subsampling}, tune=psnr"
    return Codec(
        name, label, settings, AVIF_QUALITIES[subsampling], (0, 99), encode, pillow_decode,
        partial(pillow_version, "avif"), whole=True, default=default,
    )  # fmt: skip


def pxi(
    name: str, label: str, effort: int, texture: str = "pyramid", *,
    masks: bool = False, default: bool = True,
) -> Codec:  # fmt: skip
    """Entry for our own codec."""
    layers = "layers of the label maps" if masks else "one layer"
    return Codec(
        name, label, f"{texture}, effort {effort}, {layers}", PXI_QUALITIES, (0, 100),
        partial(pxi_encode, texture=texture, effort=effort), pxi_decode, pxi_version,
        masks=masks, default=default,
    )  # fmt: skip


def codecs(effort: int = EFFORT) -> dict[str, Codec]:
    """All codecs by name, in the order of the tables; `effort` is the effort of our own."""
    table = [
        Codec(
            "jpeg", "JPEG", "4:2:0, optimized Huffman tables",
            (4, 9, 18, 34, 55, 70, 79), (0, 100),
            partial(pillow_encode, kind="JPEG", subsampling="4:2:0", optimize=True),
            pillow_decode, partial(pillow_version, "libjpeg_turbo"), whole=True, alpha=False,
        ),
        Codec(
            "webp", "WebP", "lossy, method 6",
            (0, 3, 15, 38, 62, 77, 86), (0, 100),
            partial(pillow_encode, kind="WEBP", method=6),
            pillow_decode, partial(pillow_version, "webp"), whole=True,
        ),
        Codec(
            "jp2", "JPEG 2000", "OpenJPEG by rate, quality is bits a pixel",
            (0.1, 0.2, 0.35, 0.55, 0.8, 1.1, 1.5), (0.01, 24),
            jpeg2000_encode, pillow_decode, partial(pillow_version, "jpg_2000"),
        ),
        Codec(
            "jxl", "JPEG XL", "lossy, effort 7",
            (1, 12, 30, 52, 70, 80, 86), (0, 99),
            jpegxl_encode, jpegxl_decode, jpegxl_version, whole=True,
        ),
        avif("avif420", "AVIF 4:2:0", 4, "4:2:0"),
        avif("avif444", "AVIF 4:4:4", 4, "4:4:4"),
        avif("avif420-s0", "AVIF 4:2:0 speed 0", 0, "4:2:0", default=False),
        *(avif(f"avif444-s{n}", f"AVIF 4:4:4 speed {n}", n, "4:4:4", default=False)
          for n in EQUAL_TIME),
        Codec(
            "svt", "AVIF by SVT-AV1", "preset 2, 4:2:0, tune=psnr, quality is CRF",
            SVT_QUALITIES, (1, 63), partial(svt_encode, preset=2), pillow_decode, svt_version,
            whole=True, alpha=False, default=False,
        ),
        pxi("pxi-fast", "pxi fast", FAST_EFFORT),
        pxi("pxi", "pxi", effort),
        pxi("pxi-masks", "pxi with layers", effort, masks=True, default=False),
        pxi("pxi-implicit", "pxi implicit", effort, "implicit", default=False),
    ]  # fmt: skip
    return {codec.name: codec for codec in table}

"""Colour of picture files: what their numbers mean, what is carried, and conversion to sRGB.

Colours are converted by littlecms (in imagecodecs) on floating point. What stands beside the
pixels is an ICC profile of RGB (block ``icc``), or four numbers of ITU-T H.273 as in a cICP chunk
of PNG (block ``cicp``): primaries, transfer, matrix 0 and range 1.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import UnsupportedError
from .samples import Floats, unit

Pixels = NDArray[Any]

Chromaticities = tuple[float, ...]
"""x and y of red, green, blue and white."""

_D65, _C = (0.3127, 0.3290), (0.310, 0.316)
SRGB: Chromaticities = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, *_D65)
PRIMARIES: dict[int, Chromaticities] = {
    1: SRGB,
    4: (0.67, 0.33, 0.21, 0.71, 0.14, 0.08, *_C),
    5: (0.64, 0.33, 0.29, 0.60, 0.15, 0.06, *_D65),
    6: (0.630, 0.340, 0.310, 0.595, 0.155, 0.070, *_D65),
    7: (0.630, 0.340, 0.310, 0.595, 0.155, 0.070, *_D65),
    8: (0.681, 0.319, 0.243, 0.692, 0.145, 0.049, *_C),
    9: (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, *_D65),
    10: (1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1 / 3, 1 / 3),
    11: (0.680, 0.320, 0.265, 0.690, 0.150, 0.060, 0.314, 0.351),
    12: (0.680, 0.320, 0.265, 0.690, 0.150, 0.060, *_D65),
    22: (0.630, 0.340, 0.295, 0.605, 0.155, 0.077, *_D65),
}
"""Primaries by their number (ITU-T H.273, table 2)."""

LINEAR, PQ, HLG = 8, 16, 18
REFERENCE_WHITE = 203.0
"""Light in cd/m² of diffuse white in pictures of high dynamic range (ITU-R BT.2408)."""

_RELATIVE, _BLACK_POINT = 1, 0x2000
"""Rendering intent relative colorimetric, and the flag of black point compensation (littlecms)."""

_ROUNDING = 1e-3
"""Samples that a conversion puts outside 0..1 by no more than this are at its ends."""


COLOUR = ("icc", "cicp")
"""Blocks that say what colours pixels are."""


@dataclass(frozen=True)
class Colour:
    """Statement of a file about its colour. The first of these that is there counts.

    Attributes:
        cicp: Primaries, transfer, matrix and range of ITU-T H.273, or None.
        icc: ICC profile, or empty.
        inks: Whether the pixels are cyan, magenta, yellow and black.
        gamma: Exponent from numbers to light, 1 being linear; None for the curve of sRGB.
        chromaticities: Those of the primaries and the white.
        lab: Whether the pixels are CIE L*a*b* as in TIFF files.
    """

    cicp: tuple[int, ...] | None = None
    icc: bytes = b""
    inks: bool = False
    gamma: float | None = None
    chromaticities: Chromaticities = SRGB
    lab: bool = False


ADOBE_RGB = Colour(gamma=563 / 256, chromaticities=(0.64, 0.33, 0.21, 0.71, 0.15, 0.06, *_D65))


def _bt709(v: Pixels) -> Pixels:
    return np.where(v < 0.081, v / 4.5, ((v + 0.099) / 1.099) ** (1 / 0.45))


def _srgb(v: Pixels) -> Pixels:
    return np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)


def _pq(v: Pixels) -> Pixels:
    """Light of PQ (SMPTE ST 2084), 1 being `REFERENCE_WHITE`."""
    power = v ** (32 / 2523)
    light = np.maximum(power - 3424 / 4096, 0) / (2413 / 128 - 2392 / 128 * power)
    return np.asarray(10_000 / REFERENCE_WHITE * light ** (16384 / 2610))


def _hlg(v: Pixels) -> Pixels:
    """Light of HLG (ITU-R BT.2100) on a display of 1000 cd/m², 1 being `REFERENCE_WHITE`."""
    a, b, c = 0.17883277, 0.28466892, 0.55991073
    scene = np.where(v <= 0.5, v * v / 3, (np.exp((v - c) / a) + b) / 12)
    bright = scene @ np.array([0.2627, 0.6780, 0.0593])
    return np.asarray(1000 / REFERENCE_WHITE * scene * bright[..., None] ** 0.2)


_LIGHT: dict[int, Callable[[Pixels], Pixels]] = {
    **dict.fromkeys((1, 6, 11, 12, 14, 15), _bt709),
    4: lambda v: v**2.2,
    5: lambda v: v**2.8,
    7: lambda v: np.where(v < 0.0912, v / 4, ((v + 0.1115) / 1.1115) ** (1 / 0.45)),
    LINEAR: lambda v: v,
    9: lambda v: np.where(v > 0, 10 ** (2 * (v - 1)), 0),
    10: lambda v: np.where(v > 0, 10 ** (2.5 * (v - 1)), 0),
    13: _srgb,
    PQ: _pq,
    17: lambda v: 52.37 / 48 * v**2.6,
    HLG: _hlg,
}
"""Functions from numbers in 0..1 to light, by the number of the transfer (ITU-T H.273, table 3)."""


def adopt(pixels: Pixels, stated: Colour) -> tuple[Pixels, dict[str, bytes], list[str]]:
    """Carries the colour that a file states, or converts its pixels to sRGB.

    An RGB profile and H.273 numbers are carried; PNG's gAMA and cHRM become a profile. Linear
    light, and profiles of grey or CMYK, are converted.

    Args:
        pixels: [H, W, 1..4] uint8, uint16 or float32; four inks if `stated` says so.
        stated: The statement of the file.

    Returns:
        The pixels, with at most 4 channels and perhaps as float32; blocks ``icc`` and ``cicp`` that
        belong to them; and remarks on what was converted or left out.

    Raises:
        UnsupportedError: imagecodecs, which converts, is not installed.
    """
    notes: list[str] = []
    if stated.lab:
        return _from_lab(pixels), {}, ["converted from CIE L*a*b* to sRGB"]
    if stated.cicp is not None:
        problem = cicp_problem(bytes(stated.cicp[:3]) + b"\1")
        if problem is None:
            return _with_cicp(pixels, stated)
        notes.append(f"its cICP {stated.cicp} is left out: {problem}")
    space = stated.icc[16:20]
    if space == b"RGB " and not stated.inks:
        return pixels, {"icc": stated.icc}, notes
    grey = space == b"GRAY" and pixels.shape[2] <= 2
    if stated.inks or grey:
        kind = "grey" if grey else "CMYK"
        _cms()
        try:
            found = _from_profile(pixels, stated.icc, grey)
            notes.append(f"converted from its {kind} profile to sRGB")
        except UnsupportedError:
            found = _mixed(pixels) if stated.inks else pixels
            notes.append(f"its {kind} profile is damaged, and not used")
        return found, {}, notes
    if stated.icc:
        notes.append("its ICC profile is not one of such pixels, and left out")
    if stated.gamma is not None and abs(stated.gamma - 1) < 0.05:
        notes.append("converted from linear light to sRGB")
        return _from_linear(pixels, stated.chromaticities), {}, notes
    if stated == Colour(icc=stated.icc):
        return pixels, {}, notes
    return pixels, {"icc": _profile(stated.chromaticities, stated.gamma)}, notes


def _with_cicp(pixels: Pixels, stated: Colour) -> tuple[Pixels, dict[str, bytes], list[str]]:
    """`adopt` for H.273 numbers that mean something."""
    assert stated.cicp is not None, "the caller has looked"
    primaries, transfer, _, full = stated.cicp
    notes = []
    if not full:
        pixels = _full_range(pixels)
        notes.append("stretched from narrow to full range")
    if transfer == LINEAR:
        notes.append("converted from linear light to sRGB")
        return _from_linear(pixels, PRIMARIES[primaries]), {}, notes
    if (primaries, transfer) == (1, 13):
        return pixels, {}, notes
    blocks = {"cicp": bytes([primaries, transfer, 0, 1])}
    if stated.icc[16:20] == b"RGB ":
        blocks["icc"] = stated.icc
    return pixels, blocks, notes


def cicp_problem(cicp: bytes) -> str | None:
    """Reason why four numbers of H.273 cannot stand beside RGB pixels; None if they can."""
    if len(cicp) != 4:
        return "it must be 4 bytes"
    primaries, transfer, matrix, full = cicp
    if primaries not in PRIMARIES or transfer not in _LIGHT:
        return f"primaries {primaries} and transfer {transfer} are unspecified or unknown"
    return None if (matrix, full) == (0, 1) else "RGB has matrix 0 and range 1"


def _full_range(pixels: Pixels) -> Pixels:
    """Stretches narrow-range RGB, 16..235 of 8 bits, to 0..1; alpha stays as it is (H.273, 8.3)."""
    values = unit(pixels).copy()
    bits = 16 if pixels.dtype == np.uint16 else 8
    colours = _colours(values)
    top = (1 << bits) - 1
    scaled = (values[..., :colours] * top - (16 << (bits - 8))) / (219 << (bits - 8))
    values[..., :colours] = np.clip(scaled, 0, 1)
    return values


def _colours(pixels: Pixels) -> int:
    """Number of channels before alpha: 1 or 3."""
    return 3 if pixels.shape[2] > 2 else 1


def _cms() -> Any:
    try:
        import imagecodecs
    except ImportError:
        raise UnsupportedError(
            "to convert colours needs imagecodecs: pip install 'proxyimg-codec[io]'"
        ) from None
    return imagecodecs


def _profile(chromaticities: Chromaticities, gamma: float | None, cicp: int = 13) -> bytes:
    """ICC profile of primaries and an exponent or, by default, a transfer of H.273."""
    red, green, blue, white = np.reshape(chromaticities, (4, 2)).tolist()
    curve: dict[str, Any] = {"gamma": gamma}
    if gamma is None:
        table = _LIGHT[cicp](np.linspace(0, 1, 1024))
        curve = {"transferfunction": np.rint(np.clip(table, 0, 1) * 65535).astype(np.uint16)}
    made: bytes = _cms().cms_profile(
        "rgb", whitepoint=(*white, 1.0), primaries=[*red, 1.0, *green, 1.0, *blue, 1.0], **curve
    )
    # littlecms writes the time of day.
    return made[:24] + struct.pack(">6H", 2000, 1, 1, 0, 0, 0) + made[36:]


def _transformed(colour: Pixels, source: bytes, target: bytes, kind: str = "rgb") -> Floats:
    """Colours [H, W, C], or grey [H, W], of one profile as float32 [H, W, 3] of another, of RGB."""
    cms = _cms()
    try:
        out: Floats = cms.cms_transform(
            np.ascontiguousarray(colour), source, target, colorspace=kind, planar=False,
            outcolorspace="rgb", outplanar=False, outdtype="float32", intent=_RELATIVE,
            flags=_BLACK_POINT,
        )  # fmt: skip
    except (cms.CmsError, ValueError) as error:
        raise UnsupportedError(f"the ICC profile cannot be used: {error}") from None
    return out


def _srgb_profile() -> bytes:
    made: bytes = _cms().cms_profile("srgb")
    return made


def _rounded(values: Floats) -> Floats:
    """Samples with those at the ends of 0..1 that are outside by a rounding error."""
    near = (values > -_ROUNDING) & (values < 1 + _ROUNDING)
    return np.where(near, np.clip(values, 0, 1), values).astype(np.float32)


def _from_linear(pixels: Pixels, chromaticities: Chromaticities) -> Floats:
    """Linear light [H, W, 1..4] with straight alpha, as sRGB in float32; beyond 0..1 if it was."""
    values, colours = unit(pixels), _colours(pixels)
    three = values[..., :3] if colours == 3 else np.repeat(values[..., :1], 3, axis=2)
    if not np.isfinite(three).all():
        return values
    light = _transformed(three, _profile(chromaticities, 1.0), _srgb_profile())
    return np.concatenate([_rounded(light)[..., :colours], values[..., colours:]], axis=2)


def _from_profile(pixels: Pixels, icc: bytes, grey: bool) -> Floats:
    """Pixels of a profile of grey, perhaps with alpha, or CMYK, as sRGB in float32."""
    if grey:
        out = _transformed(pixels[..., 0], icc, _srgb_profile(), "gray")[..., :1]
        out = np.concatenate([out, unit(pixels[..., 1:])], axis=2)
    else:
        out = _transformed(pixels[..., :4], icc, _srgb_profile(), "cmyk")
    return np.asarray(np.clip(out, 0, 1), np.float32)


def _from_lab(pixels: Pixels) -> Floats:
    """Pixels of CIE L*a*b* as sRGB in float32.

    They are uint8 or uint16 [H, W, 3], in which a* and b* have a sign (TIFF 6.0, section 23).
    """
    signed = pixels[..., 1:].astype(f"i{pixels.dtype.itemsize}")
    steps = 1 if pixels.dtype == np.uint8 else 256
    lab = np.concatenate([100 * unit(pixels[..., :1]), signed / np.float32(steps)], axis=2)
    source = _cms().cms_profile("lab4")
    colour = _transformed(lab.astype(np.float32), source, _srgb_profile(), "lab")
    return np.asarray(np.clip(colour, 0, 1), np.float32)


def _mixed(inks: Pixels) -> Floats:
    """RGB of inks without a profile: what each ink, and black, leave of the light."""
    values = 1 - unit(inks)
    return np.asarray(values[..., :3] * values[..., 3:4], np.float32)


def is_srgb(blocks: Mapping[str, bytes]) -> bool:
    """Whether pixels with these blocks are sRGB."""
    return not any(name in blocks for name in COLOUR)


def is_hdr(blocks: Mapping[str, bytes]) -> bool:
    """Whether pixels with these blocks are of high dynamic range, PQ or HLG."""
    return blocks.get("cicp", b"\0\0")[1] in (PQ, HLG)


def to_srgb(pixels: Pixels, blocks: Mapping[str, bytes]) -> Floats:
    """Converts pixels to sRGB. Colours that it cannot show are clipped.

    Of PQ and HLG, diffuse white (`REFERENCE_WHITE`) becomes 1, and brighter light is clipped.

    Args:
        pixels: [H, W, 1..4] uint8, uint16, or float32 in 0..1, with straight alpha.
        blocks: What they mean: ``icc`` and ``cicp``, of which the second counts.

    Returns:
        float32 [H, W, 3] or, with alpha, [H, W, 4] in 0..1.

    Raises:
        UnsupportedError: The profile is damaged, or imagecodecs is not installed.
    """
    return np.clip(_converted(pixels, blocks, _srgb_profile), 0, 1)


def same_colours(blocks: Mapping[str, bytes], others: Mapping[str, bytes]) -> bool:
    """Whether two pictures with these blocks have the same colours, as far as blocks tell."""
    return all(blocks.get(name) == others.get(name) for name in COLOUR)


def to_colours(pixels: Pixels, blocks: Mapping[str, bytes], target: Mapping[str, bytes]) -> Floats:
    """Converts pixels to the colours of another picture. Those that it cannot show are clipped.

    Args:
        pixels: As `to_srgb`.
        blocks: As `to_srgb`.
        target: Blocks that say what colours the other picture has.

    Returns:
        float32 [H, W, 3] or, with alpha, [H, W, 4] in 0..1.

    Raises:
        UnsupportedError: A profile is damaged, the other picture is of high dynamic range, or
            imagecodecs is not installed.
    """
    icc = target.get("icc") if "cicp" not in target else profile_of(target["cicp"])
    if not is_srgb(target) and icc is None:
        raise UnsupportedError("colours cannot be converted to high dynamic range (PQ, HLG)")
    profile = icc or _srgb_profile()
    return np.clip(_converted(pixels, blocks, lambda: profile), 0, 1)


def to_linear(pixels: Pixels, blocks: Mapping[str, bytes]) -> Floats:
    """Converts pixels to linear light with the primaries of sRGB, perhaps beyond 0..1.

    Args:
        pixels: As `to_srgb`.
        blocks: As `to_srgb`.

    Raises:
        UnsupportedError: As `to_srgb`.
    """
    return _converted(pixels, blocks, lambda: _profile(SRGB, 1.0))


def _converted(pixels: Pixels, blocks: Mapping[str, bytes], target: Callable[[], bytes]) -> Floats:
    """Pixels as float32 in the colours of a profile; alpha as it is."""
    values, cicp = unit(pixels), blocks.get("cicp", b"")
    if _colours(values) == 1:
        values = np.concatenate([np.repeat(values[..., :1], 3, axis=2), values[..., 1:]], axis=2)
    if cicp_problem(cicp) is None:
        light = np.asarray(_LIGHT[cicp[1]](values[..., :3].astype(np.float64)), np.float32)
        colour = _transformed(light, _profile(PRIMARIES[cicp[0]], 1.0), target())
    else:
        colour = _transformed(values[..., :3], blocks.get("icc") or _srgb_profile(), target())
    return np.concatenate([_rounded(colour), values[..., 3:]], axis=2)


def profile_of(cicp: bytes) -> bytes | None:
    """ICC profile that says what ``cicp`` says; None for high dynamic range, which has none.

    Raises:
        UnsupportedError: imagecodecs is not installed.
    """
    if is_hdr({"cicp": cicp}) or cicp_problem(cicp) is not None:
        return None
    return _profile(PRIMARIES[cicp[0]], None, cicp[1])

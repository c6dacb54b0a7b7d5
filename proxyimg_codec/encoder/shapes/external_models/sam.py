"""Models of the SAM family: an encoder that sees a picture once, a decoder that answers prompts.

Interfaces are those of the public exporters: `segment_anything` and `samexporter` for SAM and
MobileSAM, `labelme` for EfficientSAM, `samexporter` for SAM 2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ....errors import InputError
from ..onnx_model import Array, Floats, Model
from .kinds import Kind, kind_of
from .pixels import IMAGENET_MEAN, IMAGENET_STD, planes

SIDE = 1024
"""Longer side in pixels of what encoders see."""

LOW = 256
"""Side of the masks that SAM and SAM 2 draw, over all of what the encoder sees."""

FRAME = 512
"""Longer side of masks as they are returned by `View.masks`."""

SAM_MEAN, SAM_STD = (123.675, 116.28, 103.53), (58.395, 57.12, 57.375)
"""Mean and deviation of colours in 0..255 by which SAM was trained."""

INSIDE, OUTSIDE, CORNER, OTHER_CORNER, PADDING = 1, 0, 2, 3, -1
"""Labels of points: of the object, not of it, the corners of a box, none."""


@dataclass(frozen=True, eq=False)
class View:
    """Picture as a model has seen it.

    Attributes:
        encoder: The encoder, or the whole model.
        decoder: The decoder; None if the model is in one piece and looks again for each prompt.
        size: Height and width of the picture in pixels.
        scale: Factors from x and y in pixels of the picture to what the encoder sees.
        features: Outputs of the encoder by the names of the decoder's inputs; of a model in one
            piece the picture.
    """

    encoder: Model
    decoder: Model | None
    size: tuple[int, int]
    scale: tuple[float, float]
    features: dict[str, Array]

    @property
    def frame(self) -> tuple[int, int]:
        """Height and width of masks as `masks` returns them."""
        factor = min(1.0, FRAME / max(self.size))
        return max(1, round(self.size[0] * factor)), max(1, round(self.size[1] * factor))

    def masks(
        self, points: Sequence[tuple[float, float]], labels: Sequence[int]
    ) -> tuple[Floats, Floats]:
        """Masks for a prompt.

        Args:
            points: Points x, y in pixels of the picture; the first reaches from 0, 0 to 1, 1.
            labels: Label of each point, such as `INSIDE`.

        Returns:
            float32 [M, h, w], positive inside, of the size `frame`; and float32 [M], the IoU
            that the model expects of each.

        Raises:
            InputError: The model does not run, or its outputs have other shapes.
        """
        model = self.decoder or self.encoder
        batched = any(t.name == "batched_point_coords" for t in model.inputs)
        feeds, names = (_batched if batched else _plain)(self, model, points, labels)
        outputs = [t.name for t in model.outputs]
        low = names[0] == "masks" and "low_res_masks" in outputs
        wanted = ["low_res_masks" if low else names[0], names[1]]
        found, quality = model.run(feeds, wanted)
        if found.ndim < 3 or found.shape[-3] != quality.size:
            raise InputError(
                f"{model.name}: {wanted[0]} {list(found.shape)} and {wanted[1]} "
                f"{list(quality.shape)} do not fit together"
            )
        drawn = np.asarray(found, np.float32).reshape(found.shape[-3:])
        high, wide = self.frame
        if low:  # over the padded square that the encoder sees
            square = [cv2.resize(m, (SIDE, SIDE)) for m in drawn]
            rows, cols = (max(1, round(n * s)) for n, s in zip(self.size, self.scale[::-1],
                                                               strict=True))  # fmt: skip
            drawn = np.stack([m[:rows, :cols] for m in square])
        drawn = np.stack([cv2.resize(m, (wide, high)) for m in drawn])
        return drawn, np.asarray(quality, np.float32).ravel()


def _plain(
    view: View, model: Model, points: Sequence[tuple[float, float]], labels: Sequence[int]
) -> tuple[dict[str, Array], tuple[str, str]]:
    """Inputs of the decoders of SAM and SAM 2, and the names of masks and qualities."""
    # Models add half a pixel themselves. The last point stands for no box.
    places = [(x * view.scale[0] - 0.5, y * view.scale[1] - 0.5) for x, y in points]
    feeds: dict[str, Array] = {
        **view.features,
        "point_coords": np.asarray([[*places, (0, 0)]], np.float32),
        "point_labels": np.asarray([[*labels, PADDING]], np.float32),
        "mask_input": np.zeros((1, 1, LOW, LOW), np.float32),
        "has_mask_input": np.zeros(1, np.float32),
        "orig_im_size": np.asarray(view.frame, np.float32),
    }
    asked = {t.name for t in model.inputs}
    return {k: v for k, v in feeds.items() if k in asked}, ("masks", "iou_predictions")


def _batched(
    view: View, model: Model, points: Sequence[tuple[float, float]], labels: Sequence[int]
) -> tuple[dict[str, Array], tuple[str, str]]:
    """Inputs of EfficientSAM, and the names of masks and qualities."""
    # It knows no points outside of the object; they decide between its masks later.
    known = [(p, v) for p, v in zip(points, labels, strict=True) if v != OUTSIDE]
    high, wide = view.frame if view.decoder else view.features["batched_images"].shape[2:]
    factors = wide / view.size[1], high / view.size[0]
    feeds: dict[str, Array] = {
        **view.features,
        "batched_point_coords": np.asarray(
            [[[np.multiply(p, factors) for p, _ in known]]], np.float32
        ),
        "batched_point_labels": np.asarray([[[v for _, v in known]]], np.float32),
        "orig_im_size": np.array((high, wide)),
    }
    asked = {t.name for t in model.inputs}
    return {k: v for k, v in feeds.items() if k in asked}, ("output_masks", "iou_predictions")


def see(encoder: Model, decoder: Model | None, rgb: NDArray[np.uint8]) -> View:
    """Shows a picture to a model.

    Args:
        encoder: Encoder, or a whole EfficientSAM.
        decoder: Decoder; None for a whole model.
        rgb: uint8 [H, W, 3] picture in sRGB.

    Raises:
        InputError: The encoder does not run, or does not fit the decoder.
    """
    kind = kind_of(encoder)
    height, width = rgb.shape[:2]
    wanted = encoder.inputs[0]
    if kind is Kind.SAM2_ENCODER:
        high, wide = wanted.shape[2] or SIDE, wanted.shape[3] or SIDE
        picture = planes(_scaled(rgb, high, wide) / 255, IMAGENET_MEAN, IMAGENET_STD)
    else:
        rows = len(wanted.shape) == 3
        limit = wanted.shape[:2] if rows else wanted.shape[2:4]
        factor = min((limit[0] or SIDE) / height, (limit[1] or SIDE) / width)
        high, wide = max(1, round(height * factor)), max(1, round(width * factor))
        scaled = _scaled(rgb, high, wide)
        if kind is not Kind.SAM_ENCODER:
            picture = planes(scaled / 255, (0,) * 3, (1,) * 3)
        elif rows:
            below, beside = ((n or m) - m for n, m in zip(limit, (high, wide), strict=True))
            picture = np.pad(scaled, ((0, below), (0, beside), (0, 0)))
        else:
            whole = planes(scaled, SAM_MEAN, SAM_STD)
            below, beside = (n or SIDE for n in limit)
            picture = np.pad(whole, ((0, 0), (0, 0), (0, below - high), (0, beside - wide)))
    scale = wide / width, high / height
    if decoder is None:
        return View(encoder, None, (height, width), scale, {wanted.name: picture})
    names = [t.name for t in encoder.outputs]
    found = dict(zip(names, encoder.run({wanted.name: picture}), strict=True))
    if kind is Kind.SAM_ENCODER:  # exporters call its only output as they like
        found = {"image_embeddings": found[names[0]]}
    features = {t.name: found[t.name] for t in decoder.inputs if t.name in found}
    for tensor in decoder.inputs:
        given = features.get(tensor.name)
        if given is not None and not _fits(given.shape, tensor.shape):
            raise InputError(f"{decoder.name}: needs {tensor}, but {encoder.name} gives "
                             f"{list(given.shape)}; they belong to different models")  # fmt: skip
    return View(encoder, decoder, (height, width), scale, features)


def _scaled(rgb: NDArray[np.uint8], high: int, wide: int) -> Floats:
    smaller = high * wide < rgb.shape[0] * rgb.shape[1]
    method = cv2.INTER_AREA if smaller else cv2.INTER_LINEAR
    return cv2.resize(rgb, (wide, high), interpolation=method).astype(np.float32)


def _fits(shape: tuple[int, ...], wanted: tuple[int | None, ...]) -> bool:
    return len(shape) == len(wanted) and all(
        b in (None, a) for a, b in zip(shape, wanted, strict=True)
    )

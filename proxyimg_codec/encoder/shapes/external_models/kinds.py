"""Kinds of models, recognized by the names, shapes and types of their inputs and outputs."""

from __future__ import annotations

from enum import Enum

from ....errors import InputError
from ..onnx_model import Model, Tensor

PICTURE_CHANNELS = 3

SAM_EMBEDDING = 256
"""Channels of the embedding of a picture by a SAM."""

ISNET_SIDE = 640
"""Side from which on a model of figures counts as IS-Net (it has 1024), below as U²-Net (320)."""


class Kind(Enum):
    """Kinds of models; the value says what errors and tools call it."""

    SAM_ENCODER = "SAM encoder"
    SAM_DECODER = "SAM decoder"
    EFFICIENT_ENCODER = "EfficientSAM encoder"
    EFFICIENT_DECODER = "EfficientSAM decoder"
    EFFICIENT = "EfficientSAM"
    SAM2_ENCODER = "SAM 2 encoder"
    SAM2_DECODER = "SAM 2 decoder"
    U2NET = "figures, as U²-Net"
    ISNET = "figures, as IS-Net"
    DEPTH = "relative depth, as Depth Anything"
    INPAINTING = "inpainting, as LaMa"


PARTNERS = {
    Kind.SAM_ENCODER: Kind.SAM_DECODER,
    Kind.EFFICIENT_ENCODER: Kind.EFFICIENT_DECODER,
    Kind.SAM2_ENCODER: Kind.SAM2_DECODER,
}
"""Kinds of decoders by those of their encoders."""

_POINTS = {"point_coords", "point_labels"}
_BATCHED = {"batched_point_coords", "batched_point_labels"}
_FINE = {"high_res_feats_0", "high_res_feats_1"}

# Inputs and outputs by which models with names are recognized; they may have more.
_BY_NAME: tuple[tuple[Kind, set[str], set[str]], ...] = (
    (Kind.SAM2_DECODER, {"image_embed", *_FINE, *_POINTS}, {"masks", "iou_predictions"}),
    (Kind.SAM_DECODER, {"image_embeddings", *_POINTS}, {"masks", "iou_predictions"}),
    (Kind.EFFICIENT, {"batched_images", *_BATCHED}, {"output_masks", "iou_predictions"}),
    (Kind.EFFICIENT_DECODER, {"image_embeddings", *_BATCHED}, {"output_masks", "iou_predictions"}),
    (Kind.SAM2_ENCODER, set(), {"image_embed", *_FINE}),
    (Kind.EFFICIENT_ENCODER, {"batched_images"}, {"image_embeddings"}),
)

_KNOWN_INPUTS = {
    Kind.SAM_DECODER: {"image_embeddings", *_POINTS, "mask_input", "has_mask_input",
                       "orig_im_size"},
    Kind.SAM2_DECODER: {"image_embed", *_FINE, *_POINTS, "mask_input", "has_mask_input",
                        "orig_im_size"},
    Kind.EFFICIENT: {"batched_images", *_BATCHED},
    Kind.EFFICIENT_DECODER: {"image_embeddings", *_BATCHED, "orig_im_size"},
}  # fmt: skip
"""Inputs that are given to models of a kind; one that asks for more cannot be used."""

EXPECTED = """\
SAM and MobileSAM: an encoder with the output image_embeddings [1, 256, h, w], and a decoder with \
the inputs image_embeddings, point_coords, point_labels, mask_input, has_mask_input, orig_im_size \
and the outputs masks, iou_predictions; EfficientSAM: batched_images, batched_point_coords, \
batched_point_labels; SAM 2: image_embed, high_res_feats_0, high_res_feats_1; figures: one \
picture [1, 3, h, w] in, first output [1, 1, h, w]; depth: one picture in, one output [1, h, w] \
or named depth; inpainting: a picture [1, 3, h, w] and a mask [1, 1, h, w] in, a picture out"""
"""Inputs and outputs of all kinds, for errors."""


def kind_of(model: Model) -> Kind:
    """Recognizes the kind of a model.

    Raises:
        InputError: It is of no known kind; the error names its tensors and those of all kinds.
    """
    inputs = {t.name for t in model.inputs}
    outputs = {t.name for t in model.outputs}
    for kind, needed, given in _BY_NAME:
        if needed <= inputs and given <= outputs and inputs <= _KNOWN_INPUTS.get(kind, inputs):
            return kind
    shaped = _by_shape(model)
    if shaped is None:
        raise InputError(f"{model.name}: {tensors(model)} are of no known kind of model; "
                         f"known are {EXPECTED}")  # fmt: skip
    return shaped


def check_kind(model: Model, wanted: tuple[Kind, ...], use: str) -> Kind:
    """Checks that a model is of one of some kinds, and returns its kind.

    Args:
        model: The model.
        wanted: Kinds that will do.
        use: What it is to be used for, for the error.

    Raises:
        InputError: It is of another kind, or of none.
    """
    kind = kind_of(model)
    if kind not in wanted:
        names = " or ".join(k.value for k in wanted)
        raise InputError(
            f"{model.name}: this is a model of the kind {kind.value} ({tensors(model)}); {use} "
            f"needs {names}"
        )
    return kind


def tensors(model: Model) -> str:
    """Inputs and outputs of a model in words."""
    ins, outs = ("; ".join(map(str, side)) for side in (model.inputs, model.outputs))
    return f"inputs {ins} and outputs {outs}"


def _by_shape(model: Model) -> Kind | None:
    """Kind of a model with one input, a picture, or with a hole too; None if there is none."""
    if picture_and_hole(model) is not None:
        return Kind.INPAINTING
    if len(model.inputs) != 1 or not model.outputs:
        return None
    picture, first = model.inputs[0], model.outputs[0]
    axes = len(first.shape)
    if axes == 4 and first.shape[1] == SAM_EMBEDDING and len(model.outputs) == 1:
        rows = len(picture.shape) == 3 and picture.shape[2] in (PICTURE_CHANNELS, None)
        return Kind.SAM_ENCODER if rows or _planes(picture) else None
    if not _planes(picture) or not first.dtype.startswith("float"):
        return None
    if axes == 3 or (axes == 4 and "depth" in first.name.lower()):
        return Kind.DEPTH
    if axes == 4 and first.shape[1] in (1, None):
        return Kind.ISNET if (picture.shape[2] or 0) >= ISNET_SIDE else Kind.U2NET
    return None


def picture_and_hole(model: Model) -> tuple[Tensor, Tensor] | None:
    """Inputs of a model of inpainting, the picture and the mask of its hole; None of others."""
    if len(model.inputs) != 2 or not model.outputs or not _planes(model.outputs[0]):
        return None
    for picture, hole in (model.inputs, model.inputs[::-1]):
        if _planes(picture) and _planes(hole, 1) and "mask" not in picture.name.lower():
            return picture, hole
    return None


def _planes(tensor: Tensor, count: int = PICTURE_CHANNELS) -> bool:
    """Whether a tensor is a picture of so many planes, [1, count, h, w]."""
    shape = tensor.shape
    floats = tensor.dtype in ("float32", "float16")
    return len(shape) == 4 and shape[1] in (count, None) and floats

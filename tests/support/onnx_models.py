"""Small ONNX models with the interfaces of well-known ones, and answers that tests know.

SAMs find what has the colour of the place that is pointed at (the mean of the points inside and of
the corners of the box), and as a second mask all of the picture, which they believe in more.
"""

from pathlib import Path

import numpy as np
import onnx
from onnx import numpy_helper, parser

MEAN, STD = np.float32([0.485, 0.456, 0.406]), np.float32([0.229, 0.224, 0.225])


def model(text: str, **weights: np.ndarray) -> bytes:
    """A model from the text of its graph, with further weights."""
    made = parser.parse_model(f'<ir_version: 8, opset_import: ["" : 16]>\n{text}')
    made.graph.initializer.extend(numpy_helper.from_array(v, k) for k, v in weights.items())
    onnx.checker.check_model(made)
    return made.SerializeToString()


def write(path: Path, data: bytes) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)
    return path


def figures(
    side: int = 320, mean: float = MEAN[0], std: float = STD[0], shift: float = 0.0
) -> bytes:
    """U²-Net or IS-Net: the figure is how red the picture is, the second output is nothing."""
    size = f"[1, 3, {side}, {side}]"
    return model(
        f"""agraph (float{size} input) => (float[1, 1, {side}, {side}] d0, float[1] d1) {{
            d0 = Conv(input, w, b)
            d1 = Identity(b)
        }}""",
        w=np.float32([std, 0, 0]).reshape(1, 3, 1, 1),
        b=np.float32([mean + shift]),
    )


def depth(height: str = "h", width: str = "w", four: bool = False) -> bytes:
    """Depth Anything: what is red is near; sides must be multiples of 14."""
    out = "[1, 1, h, w]" if four else "[1, h, w]"
    last = "depth = Identity(red)" if four else "depth = Squeeze(red, one)"
    return model(
        f"""agraph (float[1, 3, {height}, {width}] image) => (float{out} depth) {{
            patches = SpaceToDepth<blocksize = 14>(image)
            same = DepthToSpace<blocksize = 14, mode = "DCR">(patches)
            red = Conv(same, w, b)
            {last}
        }}""",
        w=np.float32([STD[0], 0, 0]).reshape(1, 3, 1, 1),
        b=MEAN[:1],
        one=np.int64([1]),
    )


def inpainting(side: str = "", most: float = 1.0, blur: int = 31) -> bytes:
    """LaMa: means of what is around a place and not in the hole; other colours by one half.

    Args:
        side: Height and width, as in ``"512, 512"``; if empty they are free, in multiples of 8.
        most: What white is.
        blur: Side of the square of which the mean is taken, an odd number.
    """
    size = side or "h, w"
    square, pads = [blur] * 2, [blur // 2] * 4
    pool = f"AveragePool<kernel_shape = {square}, pads = {pads}, count_include_pad = 1>"
    return model(
        f"""agraph (float[b, 3, {size}] image, float[b, 1, {size}] mask)
            => (float[b, 3, H, W] output) {{
            patches = SpaceToDepth<blocksize = 8>(image)
            same = DepthToSpace<blocksize = 8>(patches)
            seen = Sub(one, mask)
            total = {pool}(same)
            count = {pool}(seen)
            weight = Max(count, least)
            mean = Div(total, weight)
            inside = Mul(mean, mask)
            half = Mul(same, middle)
            all = Add(inside, half)
            output = Mul(all, most)
        }}""",
        one=np.float32([1]), least=np.float32([1e-6]), middle=np.float32([0.5]),
        most=np.float32([most]),
    )  # fmt: skip


EMBED = np.eye(256, 3, dtype=np.float32).reshape(256, 3, 1, 1)


def sam_encoder(rows: bool = False) -> bytes:
    """SAM: normalized planes, or with `rows` the bare picture, which it normalizes and pads."""
    if not rows:
        return model(
            """agraph (float[1, 3, 1024, 1024] x) => (float[1, 256, 64, 64] image_embeddings) {
                small = AveragePool<kernel_shape = [16, 16], strides = [16, 16]>(x)
                image_embeddings = Conv(small, w)
            }""",
            w=EMBED,
        )
    return model(
        """agraph (float[h, w, 3] input_image) => (float[1, 256, 64, 64] image_embeddings) {
            planes = Transpose<perm = [2, 0, 1]>(input_image)
            one = Unsqueeze(planes, zero)
            shape = Shape(one)
            missing = Sub(full, shape)
            pads = Concat<axis = 0>(none, missing)
            padded = Pad(one, pads)
            small = AveragePool<kernel_shape = [16, 16], strides = [16, 16]>(padded)
            image_embeddings = Conv(small, w)
        }""",
        w=EMBED / 58,
        zero=np.int64([0]),
        full=np.int64([1, 3, 1024, 1024]),
        none=np.int64([0, 0, 0, 0]),
    )


def _answer(points: str, labels: str, unit: str) -> str:
    """Graph from points, labels and `embed` to `both` [1, 2, 64, 64]; `unit` is a cell, x and y."""
    return f"""
        coords = Reshape({points}, rows2)
        marks = Reshape({labels}, rows1)
        inside = Greater(marks, zero)
        weight = Cast<to = 1>(inside)
        weighted = Mul(coords, weight)
        total = ReduceSum<keepdims = 0>(weighted, axis0)
        count = ReduceSum<keepdims = 0>(weight, axis0)
        centre = Div(total, count)
        cells = Div(centre, {unit})
        whole = Floor(cells)
        index = Mul(whole, strides)
        flat = ReduceSum<keepdims = 1>(index, axis0)
        number = Cast<to = 7>(flat)
        colours = Slice(embed, begin, three, axis1)
        table = Reshape(colours, grid)
        own = Gather<axis = 1>(table, number)
        column = Reshape(own, point)
        apart = Sub(colours, column)
        size = Abs(apart)
        difference = ReduceSum<keepdims = 1>(size, axis1)
        margin = Sub(half, difference)
        same = Mul(margin, steep)
        all = Add(same, much)
        both = Concat<axis = 1>(same, all)
    """


CONSTANTS = {
    "rows2": np.int64([-1, 2]), "rows1": np.int64([-1, 1]), "zero": np.float32([0]),
    "axis0": np.int64([0]), "axis1": np.int64([1]), "strides": np.float32([1, 64]),
    "begin": np.int64([0]), "three": np.int64([3]), "grid": np.int64([3, 4096]),
    "point": np.int64([1, 3, 1, 1]), "half": np.float32([0.5]), "steep": np.float32([20]),
    "much": np.float32([1000]), "iou": np.float32([[0.9, 0.95]]),
}  # fmt: skip


def sam_decoder() -> bytes:
    """SAM: its `masks` have a wrong ratio, as those of exporters that trace the crop."""
    return model(
        f"""agraph (float[1, 256, 64, 64] image_embeddings, float[1, n, 2] point_coords,
            float[1, n] point_labels, float[1, 1, 256, 256] mask_input, float[1] has_mask_input,
            float[2] orig_im_size) => (float[1, 2, 256, 256] masks, float[1, 2] iou_predictions,
            float[1, 2, 256, 256] low_res_masks) {{
            embed = Identity(image_embeddings)
            {_answer("point_coords", "point_labels", "unit")}
            low_res_masks = Resize(both, , , sizes256)
            masks = Identity(low_res_masks)
            iou_predictions = Identity(iou)
        }}""",
        **CONSTANTS,
        unit=np.float32([16, 16]),
        sizes256=np.int64([1, 2, 256, 256]),
    )


def efficient_encoder() -> bytes:
    return model(
        """agraph (float[b, 3, h, w] batched_images) => (float[1, 256, 64, 64] image_embeddings) {
            small = Resize<mode = "linear">(batched_images, , , sizes)
            image_embeddings = Conv(small, w)
        }""",
        w=EMBED * 4,
        sizes=np.int64([1, 3, 64, 64]),
    )


def efficient_decoder() -> bytes:
    return model(
        f"""agraph (float[b, 256, 64, 64] image_embeddings, float[1, 1, n, 2] batched_point_coords,
            float[1, 1, n] batched_point_labels, int64[2] orig_im_size)
            => (float[1, 1, 2, H, W] output_masks, float[1, 1, 2] iou_predictions) {{
            embed = Identity(image_embeddings)
            real = Cast<to = 1>(orig_im_size)
            swapped = Gather(real, order)
            unit = Div(swapped, sixtyfour)
            {_answer("batched_point_coords", "batched_point_labels", "unit")}
            sizes = Concat<axis = 0>(two, orig_im_size)
            drawn = Resize(both, , , sizes)
            output_masks = Unsqueeze(drawn, axis0)
            iou_predictions = Unsqueeze(iou, axis0)
        }}""",
        **CONSTANTS,
        order=np.int64([1, 0]),
        sixtyfour=np.float32([64]),
        two=np.int64([1, 2]),
    )


def efficient() -> bytes:
    """EfficientSAM in one piece."""
    return model(
        f"""agraph (float[b, 3, h, w] batched_images, float[1, 1, n, 2] batched_point_coords,
            float[1, 1, n] batched_point_labels)
            => (float[1, 1, 2, H, W] output_masks, float[1, 1, 2] iou_predictions) {{
            small = Resize<mode = "linear">(batched_images, , , sizes64)
            embed = Conv(small, w)
            shape = Shape(batched_images)
            high_wide = Slice(shape, at2, at4, axis0)
            real = Cast<to = 1>(high_wide)
            swapped = Gather(real, order)
            unit = Div(swapped, sixtyfour)
            {_answer("batched_point_coords", "batched_point_labels", "unit")}
            sizes = Concat<axis = 0>(two, high_wide)
            drawn = Resize(both, , , sizes)
            output_masks = Unsqueeze(drawn, axis0)
            iou_predictions = Unsqueeze(iou, axis0)
        }}""",
        **CONSTANTS,
        w=EMBED * 4,
        order=np.int64([1, 0]),
        sixtyfour=np.float32([64]),
        two=np.int64([1, 2]),
        sizes64=np.int64([1, 3, 64, 64]),
        at2=np.int64([2]),
        at4=np.int64([4]),
    )


def sam2_encoder() -> bytes:
    return model(
        """agraph (float[1, 3, 1024, 1024] image) => (float[1, 1, 4, 4] high_res_feats_0,
            float[1, 1, 2, 2] high_res_feats_1, float[1, 256, 64, 64] image_embed) {
            small = AveragePool<kernel_shape = [16, 16], strides = [16, 16]>(image)
            image_embed = Conv(small, w)
            high_res_feats_0 = Identity(fine)
            high_res_feats_1 = Identity(finer)
        }""",
        w=EMBED,
        fine=np.zeros((1, 1, 4, 4), np.float32),
        finer=np.zeros((1, 1, 2, 2), np.float32),
    )


def sam2_decoder() -> bytes:
    return model(
        f"""agraph (float[1, 256, 64, 64] image_embed, float[1, 1, 4, 4] high_res_feats_0,
            float[1, 1, 2, 2] high_res_feats_1, float[m, n, 2] point_coords,
            float[m, n] point_labels, float[m, 1, 256, 256] mask_input, float[m] has_mask_input)
            => (float[1, 2, 256, 256] masks, float[1, 2] iou_predictions) {{
            embed = Identity(image_embed)
            {_answer("point_coords", "point_labels", "unit")}
            masks = Resize(both, , , sizes256)
            iou_predictions = Identity(iou)
        }}""",
        **CONSTANTS,
        unit=np.float32([16, 16]),
        sizes256=np.int64([1, 2, 256, 256]),
    )


def greedy() -> bytes:
    """A model of figures that asks for more memory than any machine has."""
    return model(
        """agraph (float[1, 3, 8, 8] input) => (float[1, 1, 8, 8] d0) {
            one = Slice(input, zero, channel, axis)
            wide = Reshape(one, flat)
            huge = Expand(wide, shape)
            sum = ReduceSum<keepdims = 0>(huge)
            d0 = Add(one, sum)
        }""",
        zero=np.int64([0]), channel=np.int64([1]), axis=np.int64([1]),
        flat=np.int64([64]), shape=np.int64([1 << 40, 64]),
    )  # fmt: skip


SAMS = {
    "sam": {"s.encoder.onnx": sam_encoder, "s.decoder.onnx": sam_decoder},
    "mobile": {
        "m_image_encoder.onnx": lambda: sam_encoder(rows=True),
        "a_decoder.onnx": sam_decoder,
    },
    "efficient": {"e_encoder.onnx": efficient_encoder, "e_decoder.onnx": efficient_decoder},
    "efficient-whole": {"efficient.onnx": efficient},
    "sam2": {"2.encoder.onnx": sam2_encoder, "2.decoder.onnx": sam2_decoder},
}
"""Files of models of the SAM family, the one that is named first."""


def write_sam(folder: Path, name: str) -> Path:
    """Writes the files of a SAM to a folder; returns the first."""
    paths = [write(folder / file, made()) for file, made in SAMS[name].items()]
    return paths[0]
